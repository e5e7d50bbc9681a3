#!/bin/sh
# Install a bundle (`make bundle`) without a network: sh install.sh [folder, default /opt/pogon]
# Its wheels are for the Python and the platform that made it, which `platform` names.
set -eu
here=$(cd "$(dirname "$0")" && pwd)
target=${1:-/opt/pogon}
wanted=$(cat "$here/platform")
found=$("${PYTHON:-python3}" -c 'import sys, sysconfig; print(f"python{sys.version_info[0]}.{sys.version_info[1]} {sysconfig.get_platform()}")')
[ "$found" = "$wanted" ] || { echo "This bundle is for $wanted, not $found: make one there, or name the Python: PYTHON=python3.11 sh install.sh" >&2; exit 1; }
"${PYTHON:-python3}" -m venv "$target"
"$target/bin/pip" install -q --no-index --find-links "$here/wheels" --require-hashes -r "$here/app.lock"
"$target/bin/pip" install -q --no-index --no-deps "$here"/pogon-*.whl
"$target/bin/python" -m app.web.compile_templates # now, since the account that runs it may not write there
echo "Installed: $target/bin/pogon run"
