#!/usr/bin/env bash
# Runs tools/check_studio.mjs. ffmpeg comes from PyPI, beside the build, where there is none; Chromium and Node
# from Debian's packages where this runs as root.
#
# usage: check_studio.sh TESSUTO [options of check_studio.mjs]
set -euo pipefail
root=$(cd "$(dirname "$0")/.." && pwd)
tools=$(realpath -m "${CARGO_TARGET_DIR:-$root/target}")/tools
missing=()
command -v node > /dev/null || missing+=(nodejs)
command -v "${CHROMIUM:-chromium}" > /dev/null || missing+=(chromium)
if [[ ${#missing[@]} -gt 0 && $(id -u) == 0 ]] && command -v apt-get > /dev/null; then
    if apt-get update -qq && apt-get install -qq -y "${missing[@]}" > /dev/null; then
        missing=()
    fi
fi
if [[ ${#missing[@]} -gt 0 ]]; then
    echo "NOT TESTED: studio in a browser: ${missing[*]} missing" >&2
    exit 0
fi
if ! command -v "${TESSUTO_FFMPEG:-ffmpeg}" > /dev/null; then
    if [[ ! -x "$tools/ffmpeg/bin/python" ]]; then
        python3 -m venv --clear "$tools/ffmpeg"
        "$tools/ffmpeg/bin/pip" install --quiet --disable-pip-version-check imageio-ffmpeg==0.8.1
    fi
    TESSUTO_FFMPEG=$("$tools/ffmpeg/bin/python" -c "import imageio_ffmpeg; print(imageio_ffmpeg.get_ffmpeg_exe())")
    export TESSUTO_FFMPEG
fi
exec node "$root/tools/check_studio.mjs" "$@"
