#!/usr/bin/env bash
# Runs the program on emulated processors without AVX2: it must end with status 6 and name what is missing; and on one
# with AVX2, where it must run.
#
# usage: check_old_processor.sh TESSUTO        (needs qemu-x86_64: apt-get install qemu-user)
set -euo pipefail
tessuto=$1
for processor in core2duo Nehalem SandyBridge; do
    status=0
    said=$(qemu-x86_64 -cpu "$processor" "$tessuto" --version 2>&1) || status=$?
    if [[ $status != 6 || "$said" != *"lacks AVX2"*"hint: "* ]]; then
        echo "$processor: ended with status $status: $said" >&2
        exit 1
    fi
done
qemu-x86_64 -cpu max "$tessuto" --version > /dev/null
echo "processors without AVX2: refused with status 6"
