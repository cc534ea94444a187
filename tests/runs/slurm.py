"""A Slurm of one node on this machine, for the tests of the jobs: munged, slurmctld and slurmd with all files in one folder."""

import getpass
import os
import re
import secrets
import shutil
import signal
import socket
import subprocess
import time

DAEMONS = ("munged", "slurmctld", "slurmd")
CONFIGURATION = """ClusterName=test
SlurmctldHost=localhost(127.0.0.1)
SlurmUser={user}
SlurmdUser={user}
AuthType=auth/munge
AuthInfo=socket={folder}/munge.socket
CredType=cred/munge
SlurmctldPort={ports[0]}
SlurmdPort={ports[1]}
CommunicationParameters=NoCtldInAddrAny,NoInAddrAny
SlurmctldPidFile={folder}/slurmctld.pid
SlurmdPidFile={folder}/slurmd.pid
StateSaveLocation={folder}/state
SlurmdSpoolDir={folder}/spool
SlurmctldLogFile={folder}/slurmctld.log
SlurmdLogFile={folder}/slurmd.log
ProctrackType=proctrack/linuxproc
TaskPlugin=task/none
MpiDefault=pmix
SelectType=select/cons_tres
SelectTypeParameters=CR_Core
AccountingStorageType=accounting_storage/none
JobCompType=jobcomp/none
SlurmdParameters=config_overrides
ReturnToService=2
MailProg=/bin/true
NodeName=localhost NodeAddr=127.0.0.1 CPUs={cores} RealMemory=16000 State=UNKNOWN
PartitionName=all Nodes=localhost Default=YES MaxTime=INFINITE State=UP
"""


def is_installed():
    return all(shutil.which(name, path=f"{os.environ['PATH']}:/usr/sbin") for name in (*DAEMONS, "sbatch"))


def free_ports(count):
    sockets = [socket.create_server(("127.0.0.1", 0)) for _ in range(count)]
    ports = [one.getsockname()[1] for one in sockets]
    for one in sockets:
        one.close()
    return ports


def wait_for(condition, seconds, what):
    end = time.time() + seconds
    while not condition():
        assert time.time() < end, f"not within {seconds} s: {what()}"
        time.sleep(0.1)


class Slurm:
    """`cores`: as many are pretended, so that jobs run side by side on fewer."""

    def __init__(self, folder, cores):
        self.folder = folder
        self.environment = os.environ | {"SLURM_CONF": f"{folder}/slurm.conf", "PATH": f"{os.environ['PATH']}:/usr/sbin"}
        for name in ("state", "spool"):
            (folder / name).mkdir()
        (folder / "munge.key").write_bytes(secrets.token_bytes(1024))
        (folder / "munge.key").chmod(0o400)
        (folder / "slurm.conf").write_text(
            CONFIGURATION.format(user=getpass.getuser(), folder=folder, ports=free_ports(2), cores=cores))
        (folder / "cgroup.conf").write_text("CgroupPlugin=cgroup/v1\nConstrainCores=no\nConstrainRAMSpace=no\n")
        files = {"key-file": "munge.key", "socket": "munge.socket", "pid-file": "munged.pid", "log-file": "munged.log",
                 "seed-file": "munged.seed"}
        self.command("munged", "--force", *(f"--{option}={folder}/{name}" for option, name in files.items()))
        self.command("slurmctld", "-c", "-f", folder / "slurm.conf")
        self.command("slurmd", "-N", "localhost", "-f", folder / "slurm.conf")
        wait_for(lambda: self.command("sinfo", "-h", "-o", "%t", check=False) == "idle", 300, self.logs)

    def stop(self):
        for name in reversed(DAEMONS):
            file = self.folder / f"{name}.pid"
            if file.exists():
                os.kill(int(file.read_text()), signal.SIGTERM)
                wait_for(lambda: not file.exists(), 300, self.logs)

    def logs(self):
        return "".join(file.read_text(errors="replace")[-2000:] for file in self.folder.glob("*.log"))

    def command(self, *words, check=True, cwd="/"):
        done = subprocess.run([str(word) for word in words], env=self.environment, cwd=cwd, capture_output=True, text=True)
        assert not check or done.returncode == 0, f"{words}: {done.stdout}{done.stderr}"
        return done.stdout.strip()

    def submit(self, script, options, arguments=(), cwd="/"):
        """The number of the job. Its environment is that of `options`, which are sbatch's."""
        return self.command("sbatch", "--parsable", *options, script, *arguments, cwd=cwd)

    def job(self, number):
        """What Slurm says of a job, by its own words."""
        return dict(re.findall(r"(\w+)=(\S*)", self.command("scontrol", "--oneliner", "show", "job", number)))

    def wait_for_state(self, number, states, seconds=600):
        """The job, once it is in one of the states."""
        wait_for(lambda: self.job(number)["JobState"] in states, seconds, lambda: f"{self.job(number)} {self.logs()}")
        return self.job(number)

    def ended(self, number, seconds=600):
        return self.wait_for_state(number, ("COMPLETED", "FAILED", "CANCELLED", "TIMEOUT", "NODE_FAIL"), seconds)
