"""A real SLURM on this machine, for tests: munge, slurmctld and slurmd, without systemd and cgroups.

`with cluster() as slurm:` starts one in a folder of its own, with a node of all cores, and ends it with every process
of its jobs. Several may run side by side. `keeper.py` is the parent of all their processes, so that they end also when
the test is killed.
"""

from __future__ import annotations

import fcntl
import json
import os
import re
import shutil
import signal
import socket
import subprocess
import sys
import time
from collections.abc import Callable, Iterator, Mapping
from contextlib import ExitStack, contextmanager, suppress
from dataclasses import dataclass
from pathlib import Path
from tempfile import gettempdir, mkdtemp

DAEMONS = ("munged", "slurmctld", "slurmd")
CLIENTS = ("sbatch", "squeue", "scancel", "sinfo")
PACKAGES = "slurmctld slurmd slurm-client munge"
PREFIX = "met-slurm-"

# States in which nothing of a job runs or will run. `squeue` and `sacct` name them so.
ENDED = frozenset({
    "BOOT_FAIL", "CANCELLED", "COMPLETED", "DEADLINE", "FAILED", "NODE_FAIL", "OUT_OF_MEMORY", "PREEMPTED", "REVOKED",
    "TIMEOUT",
})  # fmt: skip

# Schedulers look every second, and of 22.05 they look no oftener. What has ended stays in `squeue --states=all` for an
# hour. A cancelled job gets SIGTERM and 5 s. Task plugin, accounting and MPI are left out, which means none; a node's
# cores are as written here, whatever slurmd counts. SLURM listens at all addresses and refuses who lacks munge's key:
# told not to (NoInAddrAny), it listens at what the machine's name leads to, which in a container is not 127.0.0.1.
CONFIGURATION = """\
ClusterName=met
SlurmctldHost=localhost(127.0.0.1)
SlurmctldPort={ports[0]}
SlurmdPort={ports[1]}
SlurmUser={user}
SlurmdUser={user}
AuthType=auth/munge
AuthInfo=socket={folder}/munge.socket
CredType=cred/munge
StateSaveLocation={folder}/state
SlurmdSpoolDir={folder}/spool
SlurmctldPidFile={folder}/slurmctld.pid
SlurmdPidFile={folder}/slurmd.pid
SlurmctldLogFile={folder}/log/slurmctld.log
SlurmdLogFile={folder}/log/slurmd.log
MailProg=/bin/true
ProctrackType=proctrack/linuxproc
SelectType=select/cons_tres
SelectTypeParameters=CR_CPU
SchedulerType=sched/backfill
SchedulerParameters=batch_sched_delay=0,sched_interval=1,bf_interval=1
SlurmdParameters=config_overrides
ReturnToService=2
SlurmdTimeout=0
KillWait=5
MinJobAge=3600
NodeName=here NodeHostname=localhost NodeAddr=127.0.0.1 CPUs={cores} RealMemory={memory} State=UNKNOWN
PartitionName=main Nodes=here Default=YES MaxTime=INFINITE State=UP
"""


class SlurmFailed(RuntimeError):
    """SLURM did not do what a test needs of it; the message ends with its logs."""


@dataclass(frozen=True)
class Job:
    """A job, or a task of an array, as `squeue` shows it."""

    id: str  # `7`, or `7_2` for a task of an array
    state: str  # `PENDING`, `RUNNING`, `COMPLETED`, ...
    reason: str  # why it waits or failed, such as `Resources`; `None` where there is nothing to say

    @property
    def ended(self) -> bool:
        return self.state in ENDED


@dataclass(frozen=True)
class Slurm:
    """A cluster that runs. Its clients find it by `environment`."""

    folder: Path  # configuration, state and logs; removed at the end
    environment: Mapping[str, str]  # for clients and what calls them: SLURM_CONF, and no other setting of SLURM
    cores: int

    def run(self, *argv: str | Path, cwd: Path | None = None, timeout: float = 60.0) -> str:
        """What a client command prints; an exit status other than 0 raises SlurmFailed. `timeout` in s."""
        try:
            done = subprocess.run(
                argv, env=self.environment, cwd=cwd, timeout=timeout, stdin=subprocess.DEVNULL, capture_output=True,
                text=True,
            )  # fmt: skip
        except subprocess.TimeoutExpired:
            raise self.failed(f"{argv[0]} gives no answer in {timeout:g} s") from None
        if done.returncode != 0:
            words = " ".join(map(str, argv))
            raise self.failed(f"`{words}` ended with {done.returncode}: {done.stderr}{done.stdout}")
        return done.stdout

    def jobs(self) -> dict[str, Job]:
        """All jobs and tasks of arrays by id, those of the last hour that have ended too."""
        lines = self.run("squeue", "--noheader", "--array", "--states=all", "--format=%i|%T|%r").splitlines()
        found = [Job(*line.split("|", 2)) for line in lines]
        return {job.id: job for job in found}

    def wait(self, job_id: str | int, timeout: float = 60.0) -> dict[str, Job]:
        """The job when it has ended, or of an array all tasks, by id. After `timeout` s it raises SlurmFailed.

        A task that is cancelled before it began leaves no trace: SLURM forgets it at once. Asked for by its own id it
        is CANCELLED, and among the array's tasks it is missing.
        """
        deadline = time.monotonic() + timeout
        array, _, task = f"{job_id}".partition("_")
        while True:
            jobs = self.jobs()
            found = {job.id: job for job in jobs.values() if job.id.partition("_")[0] == array}
            if not found:
                raise self.failed(f"there is no job {job_id}, only {' '.join(jobs) or 'an empty queue'}")
            if task:
                found = {f"{job_id}": jobs.get(f"{job_id}", Job(f"{job_id}", "CANCELLED", "None"))}
            if all(job.ended for job in found.values()):
                return found
            if time.monotonic() > deadline:
                states = ", ".join(f"{job.id} {job.state} ({job.reason})" for job in found.values())
                raise self.failed(f"after {timeout:g} s job {job_id} has not ended: {states}")
            time.sleep(0.1)

    def cancel(self, job: str | int) -> None:
        """Cancels a job, an array (`7`) or a task of one (`7_2`). It may run on for a moment: see `wait`."""
        self.run("scancel", f"{job}")

    def clear(self, timeout: float = 60.0) -> None:
        """Cancels all jobs, and comes back when all have ended."""
        alive = [job.id for job in self.jobs().values() if not job.ended]
        if alive:
            self.run("scancel", *alive)
        for job in alive:
            self.wait(job, timeout)

    def logs(self, lines: int = 40) -> str:
        """The last lines of each program's log, for a failing test's message."""
        return _logs(self.folder, lines)

    def failed(self, message: str) -> SlurmFailed:
        return SlurmFailed(f"{message.rstrip()}\n{self.logs()}")


def missing() -> list[str]:
    """Programs of PACKAGES that are not installed."""
    return [name for name in (*DAEMONS, *CLIENTS) if _program(name) is None]


@contextmanager
def cluster(cores: int | None = None) -> Iterator[Slurm]:
    """A cluster of one node with so many cores: by default this machine's, and 2 on a machine with one."""
    sweep()
    with ExitStack() as stack:
        for left in (2, 1, 0):
            try:
                slurm = stack.enter_context(_started(cores or max(2, len(os.sched_getaffinity(0)))))
                break
            except SlurmFailed:  # such as: since we looked, somebody took a port
                if not left:
                    raise
        yield slurm


def sweep() -> None:
    """Ends what a cluster left behind whose keeper was killed with -9: jobs, their steps, the folder."""
    for held in _home().glob(f"{PREFIX}*/held"):
        try:
            if held.stat().st_uid != os.getuid():
                continue
            with held.open() as file:
                fcntl.flock(file, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except OSError:  # its keeper lives, or has just gone
            continue
        for _ in range(100):
            found = processes(held.parent)
            for pid in found:
                with suppress(ProcessLookupError):
                    os.kill(pid, signal.SIGKILL)
            if not found:
                break
            time.sleep(0.02)
        shutil.rmtree(held.parent, ignore_errors=True)


def processes(folder: Path) -> list[int]:
    """Process ids of a cluster's daemons, steps and jobs, and of its clients: all whose SLURM_CONF lies in `folder`."""
    mark = f"\0SLURM_CONF={folder}/slurm.conf\0".encode()
    found = []
    for entry in Path("/proc").glob("[0-9]*"):
        with suppress(OSError):
            if mark in b"\0" + (entry / "environ").read_bytes():
                found.append(int(entry.name))
    return found


@contextmanager
def _started(cores: int) -> Iterator[Slurm]:
    """One attempt at a cluster."""
    folder = Path(mkdtemp(prefix=PREFIX, dir=_home()))
    # munge's clients may be anyone, so it wants a way to its socket that is open to all.
    folder.chmod(0o711)
    environment = {name: value for name, value in os.environ.items() if not re.match(SETTINGS, name)}
    slurm = Slurm(folder, environment | {"SLURM_CONF": f"{folder}/slurm.conf"}, cores)
    keeper = subprocess.Popen(
        [sys.executable, "-I", Path(__file__).with_name("keeper.py"), folder],
        bufsize=0,
        stdin=subprocess.PIPE,
        env=slurm.environment,
        cwd="/",
        start_new_session=True,  # Ctrl-C is for the tests, which then end this
    )
    assert keeper.stdin is not None
    try:
        ports = _free_ports()
        _configure(folder, ports, cores)
        for name, words in _daemons(folder).items():
            keeper.stdin.write(json.dumps([name, words]).encode() + b"\n")
            if name == "munged":
                _until(slurm, (folder / "munge.socket").exists, "munge does not start")
        _until(slurm, lambda: _listens(ports[0]), "slurmctld does not start")
        _until(slurm, lambda: slurm.run("sinfo", "--noheader", "--format=%T").split() == ["idle"], "no node comes up")
        yield slurm
    finally:
        keeper.stdin.close()
        try:
            if keeper.wait(30.0) != 0:  # someone has killed it
                sweep()
        except subprocess.TimeoutExpired:
            keeper.kill()
            keeper.wait()
            raise SlurmFailed(f"processes that cannot be killed: {processes(folder)}") from None


# The surroundings may be a job's of another SLURM, or hold a user's own defaults.
SETTINGS = r"SLURM|SBATCH|SQUEUE|SCANCEL|SINFO|SRUN|SALLOC|SACCT|SCONTROL|MUNGE"


def _home() -> Path:
    """Where clusters have their folders. The path of a socket has at most 107 bytes, which a TMPDIR may use up."""
    folder = Path(gettempdir())
    return folder if len(os.fsencode(folder)) < 75 else Path("/tmp")


def _configure(folder: Path, ports: tuple[int, int], cores: int) -> None:
    for name in ("log", "state", "spool"):
        (folder / name).mkdir(mode=0o755)
    memory = os.sysconf("SC_PHYS_PAGES") * os.sysconf("SC_PAGE_SIZE") // 2**20
    text = CONFIGURATION.format(folder=folder, ports=ports, user=os.getuid(), cores=cores, memory=memory)
    (folder / "slurm.conf").write_text(text)
    # Nothing above asks for cgroups, but slurmd looks for them all the same and ends where they are not as it likes, as
    # in containers. What looks nowhere is `disabled` since 24.05, and before that version 1, until it is used.
    version = subprocess.run([f"{_program('slurmd')}", "-V"], capture_output=True, text=True).stdout
    year, month = map(int, re.findall(r"\d+", version)[:2])
    word = "disabled" if (year, month) >= (24, 5) else "cgroup/v1"
    (folder / "cgroup.conf").write_text(f"CgroupPlugin={word}\nCgroupMountpoint={folder}/cgroup\n")
    key = folder / "munge.key"
    key.touch(mode=0o600)
    key.write_bytes(os.urandom(128))


def _daemons(folder: Path) -> dict[str, list[str]]:
    """Command lines in the order of their start, by name. None goes to the background."""
    munge = [f"--{what}={folder}/munge.{end}" for what, end in
             (("key-file", "key"), ("socket", "socket"), ("pid-file", "pid"), ("seed-file", "seed"))]  # fmt: skip
    words = {
        # By force: it also wants every folder above its own open to all, which a TMPDIR need not be.
        "munged": ["--foreground", "--force", "--origin=127.0.0.1", "--num-threads=2", *munge],
        "slurmctld": ["-D"],
        "slurmd": ["-D", "-N", "here"],
    }
    return {name: [f"{_program(name)}", *rest] for name, rest in words.items()}


def _until(slurm: Slurm, holds: Callable[[], bool], otherwise: str, timeout: float = 30.0) -> None:
    """Comes back when `holds()`; raises SlurmFailed after `timeout` s, or when a program has ended."""
    deadline = time.monotonic() + timeout
    while not holds():
        for name in DAEMONS:
            file = slurm.folder / "log" / f"{name}.ended"
            if file.exists():
                raise slurm.failed(f"{otherwise}: {name} ended with {file.read_text()}")
        if time.monotonic() > deadline:
            raise slurm.failed(f"{otherwise} in {timeout:g} s")
        time.sleep(0.05)


def _free_ports() -> tuple[int, int]:
    """Two ports at which nobody listens, on any address."""
    with socket.socket() as one, socket.socket() as other:
        one.bind(("", 0))
        other.bind(("", 0))
        return one.getsockname()[1], other.getsockname()[1]


def _listens(port: int) -> bool:
    with socket.socket() as client:
        return client.connect_ex(("127.0.0.1", port)) == 0


def _program(name: str) -> str | None:
    """Where a program is; daemons lie where only root's PATH leads."""
    return shutil.which(name, path=os.environ.get("PATH", os.defpath) + ":/usr/sbin:/sbin")


def _logs(folder: Path, lines: int) -> str:
    told = []
    for name in DAEMONS:
        # A program that writes no log of its own, or has not come so far, has printed what there is to say.
        for end in ("log", "out"):
            file = folder / "log" / f"{name}.{end}"
            text = file.read_text(errors="replace").splitlines() if file.exists() else []
            if text:
                told += [f"--- {file.name}", *text[-lines:]]
                break
    return "\n".join(told)
