#!/bin/sh
# `sh environment.sh draw train`: .venv with these parts of environment.lock. What is whole stays; what is stale, moved
# or half made is made anew. PYTHON names the Python, else one is looked for; the settings of pip hold.
set -eu
unset PYTHONWARNINGS # "error" would stop pip

note() { cksum < environment.lock; pwd -P; .venv/bin/python -V; "${PYTHON:-.venv/bin/python}" -V; }
whole() ( # the lock, the folder, Python and the version of every package are as noted when the last set-up ended
  note | cmp -s - .venv/note && cd .venv/lib/python3*/site-packages && xargs ls -d < ../../../packages > /dev/null
) 2> /dev/null
missing() { for part in "$@"; do whole && grep -qx "$part" .venv/parts || echo "$part"; done; }
lock() { "$python" -c "import fcntl; fcntl.flock(9, fcntl.LOCK_EX | $1)" 2> /dev/null; }
pip() { .venv/bin/python -m pip --disable-pip-version-check "$@"; }

test "$(missing "$@")" || exit 0
for python in "${PYTHON:-python3.11}" "${PYTHON:-python3.12}" "${PYTHON:-python3.13}" "${PYTHON:-python3}" ''; do
  "$python" -c 'import ensurepip, sys; sys.exit(not (3, 11) <= sys.version_info < (3, 14))' 2> /dev/null && break
done || { echo "error: tried ${PYTHON:-python3.11 to 3.13, python3}, expected Python 3.11, 3.12 or 3.13 with venv" \
  "(Debian: apt install python3-venv). To say where it is: make PYTHON=/path/to/python3.11" >&2; exit 1; }
exec 9> .venv.lock # the system frees it however this process ends
lock fcntl.LOCK_NB || { echo 'another make is setting up .venv: waiting for it to end' >&2; lock 0; }
test "$(missing "$@")" || exit 0
trap 'test $? = 0 || echo "error: .venv is not whole, the next make begins anew; was environment.lock edited?" >&2' EXIT
trap 'exit 1' HUP INT TERM
if ! whole || test -e .venv/adding; then
  test ! -e .venv || echo '.venv is stale or not whole: it is made anew'
  echo "Setting up .venv with $python"
  rm -rf .venv && "$python" -m venv .venv
  # Every Python of .venv finds the checkout and fixes its kernels as it starts; in ASCII, whatever the locale
  fix='import sys; run = {}; exec(open(sys.prefix + "/../vsp/run/kernels.py").read(), run); run["fix"]()'
  printf '%s\n' ../../../.. "$fix" > "$(echo .venv/lib/python3*/site-packages)/vsp.pth"
fi
for part in $(missing "$@"); do
  sed -n "/^## $part: /,/^## /p" environment.lock | tee .venv/adding | sed -n '1s/^## [a-z]*/Adding to .venv/p'
  sed '/^torch==/,/[^\]$/d' .venv/adding |
    pip install -qq --no-compile --no-deps --require-hashes --requirement /dev/stdin
  torch=$(grep -o '^torch==[0-9.]*' .venv/adding) || continue
  # By itself: pip finds a CPU build only where no checksum is asked for, and the registry's build for Linux brings GPU
  # libraries, which have none here.
  pip download -qq --no-deps --dest .venv/torch "$torch"
  grep -qF -e "$(pip hash .venv/torch/*.whl | tail -n 1)" .venv/adding || {
    echo "error: SHA-256 of $(ls .venv/torch) is not among those of $torch in environment.lock" >&2; exit 1; }
  pip install -qq --no-compile .venv/torch/*.whl && rm -r .venv/torch
done
pip check > /dev/null || pip check
MPLCONFIGDIR=.venv/matplotlib .venv/bin/python -c 'import matplotlib.font_manager' # the list of fonts
(cd .venv/lib/python3*/site-packages && ls -d -- *.dist-info) > .venv/packages
missing "$@" >> .venv/parts
note > .venv/note
rm .venv/adding
