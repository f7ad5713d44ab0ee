#!/bin/sh
# all.sh   runs the ten lessons, into out/lesson-*, and writes their pictures where ParaView is installed:
#
#     pipelines/lessons/all.sh
set -eu

here=$(CDPATH='' cd "$(dirname "$0")" && pwd)
root=$here/../..
cargo run --release --manifest-path "$root/Cargo.toml" -- run "$here"/*.yaml
if command -v pvbatch >/dev/null; then
    "$root/paraview/figures" out/lesson-*
else
    echo "ParaView is not installed; the states out/lesson-*/figure.py open in it elsewhere" >&2
fi
