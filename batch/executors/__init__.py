"""Who carries tasks out: threads of this process, processes of this machine, workers of a Dask cluster.

    threads     batch/executors/threads.py     the default: nothing to start
    processes   batch/executors/processes.py   a case that kills its process, or never ends, is found out
    dask        batch/executors/dask.py        many machines

All give the same bits. What they have in common is `batch.campaigns.executor.Executor`.
"""
