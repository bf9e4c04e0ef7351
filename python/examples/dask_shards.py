"""A command in shards on a Dask cluster: the shards as its tasks, then their merge and the results.

    python dask_shards.py SHARDS OUT COMMAND...
    python dask_shards.py 8 /shared/bench bench effects --only pendulum/viscous

COMMAND is the command line without `residyn`, --shard and --out. The cluster is the one whose scheduler
$DASK_SCHEDULER_ADDRESS names, else one of processes on this machine. Its workers see OUT by the same path. Given again, it goes
on where what is there ends.
"""

import sys

from dask.distributed import Client

from residyn.shards import merge_shards, run_shard


def main() -> int:
    shards, out, *command = sys.argv[1:]
    numbers = range(1, int(shards) + 1)
    with Client() as client:
        # Not pure: what a shard does is in its folder, not in what it returns.
        done = [client.submit(run_shard, command, out, k, len(numbers), pure=False) for k in numbers]
        client.gather(done)
    return 0 if merge_shards(command, out, len(numbers)) else 1


if __name__ == "__main__":
    sys.exit(main())
