#!/usr/bin/env bash
# Makes the moving picture of README.md (docs/front.webp), docs/gallery.md, its loops and its two report pages
# (docs/gallery/).
#
# usage: tools/gallery.sh PROGRAM [--work FOLDER] [NAME …]
#
# PROGRAM          the built program, target/release/tessuto
# --work FOLDER    keeps scenes and results [target/gallery]; what is finished there is not computed again
# NAME …           only these: wind hands paper occluded blurred filmed [all, then the first picture and the page]
#
# Needs ffmpeg with the encoder libwebp_anim, and Python 3. Takes about four minutes on two cores.
set -euo pipefail
root=$(cd "$(dirname "$0")/.." && pwd)
usage() { sed -n '2,11s/^# \{0,1\}//p' "$0" >&2; exit 2; }
[[ $# -ge 1 ]] || usage
program=$(realpath "$1"); shift
work="$root/target/gallery"
if [[ "${1:-}" == --work ]]; then
    [[ $# -ge 2 ]] || usage
    work=$2; shift 2
fi
all=(wind hands paper occluded blurred filmed)
pages=(hands paper)
names=("${@:-}")
[[ -n "${names[0]}" ]] || names=("${all[@]}")

missing=()
[[ -x "$program" ]] || missing+=("the program $program: cargo build --release")
command -v python3 > /dev/null || missing+=("python3")
if ! command -v ffmpeg > /dev/null; then
    missing+=("ffmpeg")
elif ! ffmpeg -v quiet -encoders | grep libwebp_anim > /dev/null; then
    missing+=("ffmpeg's encoder libwebp_anim: a build with --enable-libwebp")
fi
if ((${#missing[@]})); then
    printf 'missing: %s\n' "${missing[@]}" >&2
    exit 1
fi

# The options of `tessuto synth` that make a scene.
options() {
    case $1 in
        wind) echo --air --wind 4 --fps 30 --frames 30 --size 320 --seed 3 ;;
        hands) echo --hands --grid 15x15 --frames 24 --size 256 --seed 1 ;;
        paper) echo --paper --frames 30 --size 256 --seed 5 ;;
        occluded) echo --occluders=2 --grid 15x15 --frames 24 --size 240 --seed 6 ;;
        blurred) echo --hands --blur --grid 15x15 --fps 25 --frames 24 --size 240 --seed 8 ;;
        filmed) echo --paper --frames 30 --size 480 ;;
        *) echo "no scene $1: ${all[*]}" >&2; exit 2 ;;
    esac
}
# The options of `tessuto reconstruct`: material and light for the first picture, physics where something moves
# the sheet.
how() {
    case $1 in
        wind) ;;
        hands) echo --no-appearance ;;
        *) echo --preset motion --no-appearance ;;
    esac
}
mkdir -p "$work" "$root/docs/gallery"
# Paths below are relative: results and pages hold the commands that made them.
cd "$work"

# Makes a scene with its truth; `filmed` is a clip with surroundings, imported by its four corners.
make_scene() {
    local name=$1
    [[ -e scenes/$name/manifest.json ]] && return
    if [[ $name != filmed ]]; then
        "$program" synth "scenes/$name" $(options "$name")
        return
    fi
    # The clip shows the same sheet as the scene of these options, whose truth it is compared with.
    [[ -e truth/manifest.json ]] || "$program" synth truth $(options filmed)
    [[ -d trial ]] || "$program" demo --clip trial
    local corners fx
    corners=$(sed -n 's/^- Corners.*: //p' trial/README.md)
    fx=$(sed -n 's/.*focal length \([0-9]*\) px.*/\1/p' trial/README.md)
    "$program" import trial/clip.mp4 scenes/filmed --outline "$corners" --fx "$fx"
    "$program" template scenes/filmed --flat 50x50cm --grid 21x21 --corners "$corners"
    cp -r truth/gt scenes/filmed/gt
}

# Reconstructs it, and renders what was found from the side; prints nothing where that is done.
make_result() {
    local name=$1
    [[ -e results/$name/manifest.json ]] || "$program" reconstruct "scenes/$name" $(how "$name") --out "results/$name"
    [[ -e side/$name/manifest.json ]] ||
        "$program" render "results/$name" --camera "$(side "$name")" --size 320x320 --samples 32 --out "side/$name"
}

# From where a scene is rendered: degrees to the left and up.
side() {
    case $1 in
        paper | filmed) echo 60,20 ;;
        *) echo 55,10 ;;
    esac
}

# One animated WebP of FILE, side px a panel, at QUALITY, of the folders of frames that follow; each loop rests
# on its last frame.
loop() {
    local file=$1 side=$2 quality=$3 inputs=() filter="" labels="" n=0 folder
    shift 3
    for folder; do
        inputs+=(-framerate 20 -pattern_type glob -i "$folder/*.png")
        filter+="[$n]scale=$side:$side:flags=area:force_original_aspect_ratio=decrease,"
        filter+="pad=$side:$side:-1:-1,tpad=stop_mode=clone:stop=8[p$n];"
        labels+="[p$n]"
        n=$((n + 1))
    done
    ffmpeg -v error -y "${inputs[@]}" -filter_complex "$filter${labels}hstack=inputs=$n:shortest=1" \
        -c:v libwebp_anim -quality "$quality" -compression_level 6 -loop 0 "$file"
}

for name in "${names[@]}"; do
    options "$name" > /dev/null
    echo "== $name"
    make_scene "$name"
    make_result "$name"
    loop "$root/docs/gallery/$name.webp" 260 55 "scenes/$name/rgbs" "side/$name"
done
[[ "${names[*]}" == "${all[*]}" ]] || exit 0

echo "== pages"
for name in "${pages[@]}"; do
    cp "results/$name/report.html" "$root/docs/gallery/$name.html"
done

echo "== front"
# Another light: a warm sun low on the left, a dim blue sky.
python3 - environment.hdr <<'PYTHON'
import math, sys
width, height, rows = 64, 32, bytearray()
for j in range(height):
    for i in range(width):
        up, across = math.pi * (0.5 - (j + 0.5) / height), 2 * math.pi * ((i + 0.5) / width - 0.5)
        away = math.acos(math.sin(up) * math.sin(0.35) + math.cos(up) * math.cos(0.35) * math.cos(across + 2.4))
        sun, sky = 11 * math.exp(-((away / 0.35) ** 2)), 0.12 + 0.1 * max(math.sin(up), 0)
        colour = [sun + 0.6 * sky, 0.62 * sun + 0.8 * sky, 0.3 * sun + 1.3 * sky]
        mantissa, exponent = math.frexp(max(colour))
        rows += bytes([*(int(c * 256 / 2**exponent) for c in colour), exponent + 128])
with open(sys.argv[1], "wb") as file:
    file.write(b"#?RADIANCE\nFORMAT=32-bit_rle_rgbe\n\n-Y %d +X %d\n" % (height, width) + rows)
PYTHON
[[ -e relit/manifest.json ]] ||
    "$program" render results/wind --camera 20,5 --environment environment.hdr --size 320x320 --samples 64 --out relit
[[ -e results/calm/manifest.json ]] || "$program" simulate results/wind --air still --out results/calm
[[ -e calm/manifest.json ]] ||
    "$program" render results/calm --camera "$(side wind)" --size 320x320 --samples 32 --out calm
loop "$root/docs/front.webp" 300 60 scenes/wind/rgbs side/wind relit calm

echo "== docs/gallery.md"
{
    for name in "${all[@]}"; do
        printf '%s\t%s\t%s\n' "$name" "$(options "$name")" "$(how "$name")"
    done
} | python3 "$root/tools/gallery.py" "${pages[@]}" > "$root/docs/gallery.md"
du -ch "$root"/docs/front.webp "$root"/docs/gallery/* | tail -1
