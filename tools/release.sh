#!/usr/bin/env bash
# Makes what is given away for this platform: the stripped program, the licences of what it contains,
# completions for shells, manual pages; as a folder and as .tar.gz with its checksum.
#
# usage: release.sh [FOLDER]        default: target/dist
#
# Asks for rust and python3; checks the program on processors without AVX2 where qemu-x86_64 is installed.
set -euo pipefail
cd "$(dirname "$0")/.."
most=16000000 # bytes of the stripped program
folder=$(realpath -m "${1:-target/dist}")
built=$(realpath -m "${CARGO_TARGET_DIR:-target}")/dist
platform=$(rustc -vV | sed -n 's/^host: //p')

# Optimised across crates: a fifth smaller than `--release`, as quick.
cargo build --profile dist --locked -p tessuto-cli
version=$("$built/tessuto" --version | cut -d' ' -f2)
name=tessuto-$version-$platform
rm -rf "${folder:?}/$name"
mkdir -p "$folder/$name/completions" "$folder/$name/man/man1"
strip -o "$folder/$name/tessuto" "$built/tessuto"
size=$(stat -c %s "$folder/$name/tessuto")
if ((size > most)); then
    echo "the stripped program has $size bytes, more than $most" >&2
    exit 1
fi
program="$folder/$name/tessuto"
"$program" completions bash > "$folder/$name/completions/tessuto.bash"
"$program" completions zsh > "$folder/$name/completions/_tessuto"
"$program" completions fish > "$folder/$name/completions/tessuto.fish"
"$program" completions elvish > "$folder/$name/completions/tessuto.elv"
"$program" completions powershell > "$folder/$name/completions/_tessuto.ps1"
python3 tools/licences.py --target "$platform" > "$folder/$name/LICENSES.txt"
cp README.md CHANGELOG.md LICENSE-MIT LICENSE-APACHE "$folder/$name"
# The crates that make manual pages are not in the program that is given away, which is copied by now.
cargo run --quiet --release --locked -p tessuto-cli --features man -- man "$folder/$name/man/man1"
rm -f "$folder/$name/man/man1/tessuto-man.1"

if command -v qemu-x86_64 > /dev/null; then
    tools/check_old_processor.sh "$program"
else
    echo "NOT TESTED: processors without AVX2 (no qemu-x86_64)"
fi
checked=$(mktemp -d)
trap 'rm -rf "$checked"' EXIT
"$program" demo --out "$checked/demo" > "$checked/log" 2>&1 || { cat "$checked/log" >&2; exit 1; }
tar --sort=name --owner=0 --group=0 --numeric-owner --mtime="@${SOURCE_DATE_EPOCH:-$(git log -1 --format=%ct)}" \
    -C "$folder" -cf - "$name" | gzip -n9 > "$folder/$name.tar.gz"
(cd "$folder" && sha256sum "$name.tar.gz" > "$name.tar.gz.sha256")
echo "$folder/$name.tar.gz: $(stat -c %s "$folder/$name.tar.gz") bytes; the program: $size bytes of at most $most"
