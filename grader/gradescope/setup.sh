#!/usr/bin/env bash
# Gradescope runs this once, as root, when it builds the image. The zip is unpacked in /autograder/source.
set -euo pipefail

root="${AUTOGRADER_ROOT:-/autograder}"
venv="$root/venv"

if command -v apt-get >/dev/null && ! { python3 -c 'import ensurepip' && command -v git && command -v bwrap; } >/dev/null 2>&1; then
  apt-get update -qq
  apt-get install -y -qq bubblewrap git python3 python3-venv
fi

python3 -c 'import sys; sys.exit(sys.version_info < (3, 10))' || {
  echo "Python 3.10 or newer is needed: choose Ubuntu 22.04 or newer as the base image." >&2
  exit 1
}
python3 -m venv "$venv"
"$venv/bin/python" -m pip install --quiet --disable-pip-version-check "$root/source/grader[wheels,colcon]"
"$venv/bin/lab2-grader" --version
