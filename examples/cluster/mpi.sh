#!/bin/sh
# A run in N pieces by mpirun, and their joining: mpi.sh N PIPELINE.yaml [options of ao4d run].
#
# Each process takes its number from the environment; ao4d itself is no MPI program and is linked with no MPI. If a process
# dies, mpirun ends the others; the same call again makes what is missing. `--bind-to none` lets every process use all cores
# that it may: with as many processes as cores say `--threads 1` instead.
set -eu
count=$1
shift
mpirun -n "$count" --bind-to none ao4d run "$@"
ao4d merge --pieces "$count" "$@"
