"""A run in pieces by Dask: dask_pieces.py N PIPELINE.yaml [SCHEDULER]

Without the address of a scheduler the workers are processes on this computer. The folder must be one that all workers see.
"""

import subprocess
import sys

from distributed import Client


def piece(k, count, pipeline):
    """Makes a piece; one that is there already is left as it is."""
    subprocess.run(["ao4d", "run", "--piece", f"{k}/{count}", "--threads", "1", pipeline], check=True)
    return k


def main():
    count, pipeline = int(sys.argv[1]), sys.argv[2]
    client = Client(*sys.argv[3:])
    jobs = client.map(piece, range(count), count=count, pipeline=pipeline, retries=2, pure=False)
    client.gather(jobs)
    subprocess.run(["ao4d", "merge", "--pieces", str(count), pipeline], check=True)


if __name__ == "__main__":
    main()
