#!/bin/sh
# Builds the Python package as pip does, and tests it: pytest, and mypy in strict mode. The virtual environment is
# target/python. Says why it tests nothing where Python 3.10 or the package index is missing.
#     sh scripts/python.sh [more options of `maturin build`, such as --no-default-features]
set -eu
cd "$(dirname "$0")/.."
target=$(cd "$(dirname "${CARGO_TARGET_DIR:-target}")" && pwd)/$(basename "${CARGO_TARGET_DIR:-target}")
venv=$target/python
skip() {
    echo "the Python package is not tested: $1"
    exit 0
}
python3 -c 'import sys; sys.exit(sys.version_info < (3, 10))' 2>/dev/null || skip "there is no Python 3.10 or later"
[ -x "$venv/bin/pip" ] || python3 -m venv "$venv" 2>/dev/null || skip "there is no python3-venv"
tools="maturin numpy pytest mypy matplotlib pandas"
"$venv/bin/python" -c "import $(echo $tools | tr ' ' ,)" 2>/dev/null ||
    "$venv/bin/pip" install --quiet --disable-pip-version-check $tools ||
    skip "the package index does not give $tools"

# Not optimised for release: cargo's tests have built most of it already.
rm -rf "$target/wheels"
"$venv/bin/maturin" build --quiet --locked --profile dev --manifest-path hosts/python/Cargo.toml \
    --interpreter "$venv/bin/python" --out "$target/wheels" "$@"
"$venv/bin/pip" install --quiet --disable-pip-version-check --no-deps --force-reinstall "$target"/wheels/*.whl

export ASPERITY_PROGRAM="${ASPERITY_PROGRAM:-$target/debug/asperity}"
[ -x "$ASPERITY_PROGRAM" ] || unset ASPERITY_PROGRAM
cd hosts/python
MYPYPATH=python:tests "$venv/bin/mypy" --cache-dir "$target/mypy" python/asperity tests
"$venv/bin/pytest" -q -p no:cacheprovider -rs
