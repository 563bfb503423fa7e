#!/usr/bin/env bash
# The C host under valgrind with every FMU of a folder: no leak, no invalid access. Usage: tests/valgrind.sh [FOLDER]
set -euo pipefail
fmus="$(cd "${1:-fmus}" && pwd)"
cd "$(dirname "$0")/.."
scratch="$(mktemp -d)"
trap 'rm -rf "$scratch"' EXIT
program='import sys; sys.path[:0] = ["tests", "."]; from pathlib import Path; import test_hosts; test_hosts.host("linux64", Path(sys.argv[1]))'
python -c "$program" "$scratch"
for fmu in "$fmus"/EMA_*.fmu; do
  name="$(basename "$fmu" .fmu)"
  python -m zipfile -e "$fmu" "$scratch/$name"
  guid="$(python -c 'import fmpy, sys; print(fmpy.read_model_description(sys.argv[1]).guid)' "$fmu")"
  valgrind --quiet --leak-check=full --error-exitcode=1 \
    "$scratch/host" "$scratch/$name/binaries/linux64/$name.so" "$guid" | wc -l | sed "s/^/$name: no error; values checked: /"
done
