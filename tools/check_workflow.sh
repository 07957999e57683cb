#!/usr/bin/env bash
# Runs tools/check_workflow.py with Snakemake from PyPI, installed beside the build once.
#
# usage: check_workflow.sh TESSUTO [--full]
set -euo pipefail
root=$(cd "$(dirname "$0")/.." && pwd)
environment=$(realpath -m "${CARGO_TARGET_DIR:-$root/target}")/tools/snakemake-9.27.1
if [[ ! -x "$environment/bin/snakemake" ]]; then
    python3 -m venv --clear "$environment"
    "$environment/bin/pip" install --quiet --disable-pip-version-check snakemake==9.27.1
fi
exec "$environment/bin/python" "$root/tools/check_workflow.py" "$1" "$environment/bin/snakemake" "${@:2}"
