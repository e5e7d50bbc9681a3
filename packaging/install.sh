#!/bin/sh
# Install a bundle (`make bundle`) without a network: sh install.sh [folder, default /opt/pogon]
set -eu
here=$(cd "$(dirname "$0")" && pwd)
target=${1:-/opt/pogon}
"${PYTHON:-python3}" -m venv "$target"
"$target/bin/pip" install -q --no-index --find-links "$here/wheels" --require-hashes -r "$here/run.lock"
"$target/bin/pip" install -q --no-index --no-deps "$here"/pogon-*.whl
echo "Installed: $target/bin/pogon run"
