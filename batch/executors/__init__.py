"""Executors of tasks: threads of this process, processes of this machine, or workers of a Dask cluster.

    threads     batch/executors/threads.py     the default: nothing to start
    processes   batch/executors/processes.py   a case that kills its process, or never ends, is found out
    dask        batch/executors/dask.py        many machines

All give the same bits, and implement `batch.campaigns.drive.Executor`.
"""
