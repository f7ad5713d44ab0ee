#!/bin/sh
# A run in N pieces by GNU parallel, and their joining: parallel.sh N PIPELINE.yaml [options of ao4d run].
#
# On several machines that share the folder: add `--sshloginfile hosts --workdir .` to parallel. What failed is tried again once;
# the same call later makes what is still missing.
set -eu
count=$1
shift
seq 0 $((count - 1)) | parallel --retries 2 --halt never ao4d run --piece "{}/$count" "$@"
ao4d merge --pieces "$count" "$@"
