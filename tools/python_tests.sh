#!/usr/bin/env bash
# The tests of the Python package and its type check, in an environment of their own below the target directory:
#   tools/python_tests.sh [arguments of pytest]
# Needs Python 3.9 or later with `venv`, and a registry of packages to install from. The gradients in PyTorch are tested
# where it is installed for the Python that runs this (Debian: python3-torch); PYTHON names another one. JAX is
# installed here; without JAX, say WITHOUT_JAX=1.
set -euo pipefail
cd "$(dirname "$0")/.."
target=$(realpath -m "${CARGO_TARGET_DIR:-target}")
# The first Python that has PyTorch, or else the first one.
python=${PYTHON:-}
if [[ -z "$python" ]]; then
    python=python3
    for candidate in python3 /usr/bin/python3; do
        if "$candidate" -c "import torch, venv, ensurepip" 2> /dev/null; then
            python=$candidate
            break
        fi
    done
fi
environment="$target/python"
stamp="$("$python" -c 'import sys; print(sys.executable, sys.version)')"
if [[ "$(cat "$environment/made-by" 2> /dev/null)" != "$stamp" ]]; then
    rm -rf "$environment"
    "$python" -m venv --system-site-packages "$environment"
    echo "$stamp" > "$environment/made-by"
fi
bin="$environment/bin"
# PyTorch of Debian 12 is built for NumPy 1; nothing else asks for an old one. The other NumPy has its turn at the end.
numpy="numpy>=2" other="numpy<2"
if "$bin/python" -c "import torch" 2> /dev/null; then
    numpy="numpy<2" other="numpy>=2"
fi
packages=("$numpy" "maturin>=1.9.4,<2" pytest "mypy>=1.11" nbclient nbformat ipykernel tqdm)
[[ -n "${WITHOUT_JAX:-}" ]] || packages+=("jax[cpu]<0.5")
"$bin/python" -m pip install --quiet --disable-pip-version-check "${packages[@]}"
# In place, by the profile of everything else, so that nothing is built twice; `pip install .` builds the same.
VIRTUAL_ENV="$environment" PATH="$bin:$PATH" "$bin/maturin" develop --release --quiet
"$bin/mypy"
# Few threads each: what is tested does not depend on it.
"$bin/python" -m pytest -q "$@"
# In an environment that has nothing else, not the program either; the package is the one that was built.
second="$target/python-other-numpy"
[[ -x "$second/bin/python" ]] || "$python" -m venv "$second"
"$second/bin/python" -m pip install --quiet --disable-pip-version-check "$other" pytest
PYTHONPATH=crates/tessuto-py/python "$second/bin/python" -m pytest -q crates/tessuto-py/tests/test_blocks.py \
    crates/tessuto-py/tests/test_scene.py \
    --deselect crates/tessuto-py/tests/test_scene.py::test_arrays_make_the_scene_of_their_folder
