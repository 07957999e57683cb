#!/usr/bin/env bash
# Makes the Python wheel that is given away for this platform, with the licences of what it contains and its checksum.
#
# usage: wheel.sh [FOLDER]        default: target/dist
#
# Asks for rust, python3 and maturin. On Linux the wheel runs where the C library is as new as this machine's.
set -euo pipefail
cd "$(dirname "$0")/.."
most=25000000 # bytes
folder=$(realpath -m "${1:-target/dist}")
platform=$(rustc -vV | sed -n 's/^host: //p')
# pyproject.toml takes every LICENSE-* along.
licences=LICENSE-THIRD-PARTY
trap 'rm -f "$licences"' EXIT
python3 tools/licences.py --target "$platform" --package tessuto-py > "$licences"
rm -f "$folder"/tessuto-*.whl "$folder"/tessuto-*.whl.sha256
maturin build --release --out "$folder"
wheel=$(basename "$(ls "$folder"/tessuto-*.whl)")
size=$(stat -c %s "$folder/$wheel")
if ((size > most)); then
    echo "the wheel has $size bytes, more than $most" >&2
    exit 1
fi
python3 -m zipfile -l "$folder/$wheel" | grep -q "licenses/$licences" || {
    echo "the licences are not in the wheel" >&2
    exit 1
}
(cd "$folder" && sha256sum "$wheel" > "$wheel.sha256")
echo "$folder/$wheel: $size bytes of at most $most"
