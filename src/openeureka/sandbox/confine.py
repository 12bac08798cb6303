"""Confines the calling process for good, by kernel mechanisms that need no privilege: limits, Landlock, seccomp.

Covered once `confine` returns: no file can be opened, no process or thread started, no socket made, no other process
signalled or traced; memory and CPU time are bounded; open descriptors are all that is left to talk through.

Not covered: faults of the kernel or of the processor, the memory of this process itself (it must hold no secret), and
how long a caller waits (`sandbox.server` owns the clock). Outside Linux on x86-64 or aarch64 nothing is covered.
"""

from __future__ import annotations

import ctypes
import os
import platform
import resource
import signal
import struct
import sys
from dataclasses import dataclass

MEMORY_BYTES = 2 << 30
CPU_SECONDS = 5

_PR_SET_PDEATHSIG, _PR_SET_NO_NEW_PRIVS, _PR_SET_SECCOMP = 1, 38, 22
_SECCOMP_MODE_FILTER, _SECCOMP_GET_ACTION_AVAIL = 2, 2
_ALLOW, _KILL_PROCESS, _ERRNO = 0x7FFF0000, 0x80000000, 0x00050000
_EPERM, _ENOSYS = 1, 38
_LANDLOCK_CREATE, _LANDLOCK_RESTRICT_SELF = 444, 446  # the same on every architecture
_LANDLOCK_VERSION = 1
_FIRST_UNUSED_UID, _LAST_UNUSED_UID = 61_000, 61_183
"""User ids between the ranges that distributions and systemd hand out."""


@dataclass(frozen=True, slots=True)
class _Architecture:
    """System call numbers, from the kernel's own tables."""

    audit: int
    """The kernel's identifier of the architecture: in another one's table, the same number is another call."""
    seccomp: int
    allowed: tuple[int, ...]
    """Calls for memory, clocks, locks, the process's own signals, and use of descriptors that are open already."""
    deadly: tuple[int, ...]
    """Calls that no honest program makes."""
    clone3: int
    """A filter cannot see the flags of this call. It is reported as unknown, so that libraries fall back to clone."""
    x32_bit: int = 0
    """Marks calls of a second table on the same processor."""


def _calls(text: str) -> tuple[int, ...]:
    return tuple(int(entry.split("=")[1]) for entry in text.split())


_ARCHITECTURES = {
    "x86_64": _Architecture(
        audit=0xC000003E,
        seccomp=317,
        allowed=_calls("""
            read=0 write=1 close=3 fstat=5 poll=7 lseek=8 mmap=9 mprotect=10 munmap=11 brk=12 rt_sigaction=13
            rt_sigprocmask=14 rt_sigreturn=15 pread64=17 readv=19 writev=20 sched_yield=24 mremap=25 madvise=28
            nanosleep=35 getpid=39 exit=60 uname=63 gettimeofday=96 getrusage=98 sysinfo=99 getuid=102 getgid=104
            geteuid=107 getegid=108 sigaltstack=131 gettid=186 futex=202 sched_getaffinity=204 restart_syscall=219
            clock_gettime=228 clock_getres=229 clock_nanosleep=230 exit_group=231 set_robust_list=273 getcpu=309
            getrandom=318 membarrier=324 rseq=334
        """),
        deadly=_calls("socket=41 clone=56 fork=57 vfork=58 execve=59 ptrace=101 execveat=322"),
        clone3=435,
        x32_bit=0x40000000,
    ),
    "aarch64": _Architecture(
        audit=0xC00000B7,
        seccomp=277,
        allowed=_calls("""
            close=57 lseek=62 read=63 write=64 readv=65 writev=66 pread64=67 ppoll=73 fstat=80 exit=93 exit_group=94
            futex=98 set_robust_list=99 nanosleep=101 clock_gettime=113 clock_getres=114 clock_nanosleep=115
            sched_getaffinity=123 sched_yield=124 restart_syscall=128 sigaltstack=132 rt_sigaction=134
            rt_sigprocmask=135 rt_sigreturn=139 uname=160 getrusage=165 getcpu=168 gettimeofday=169 getpid=172
            getuid=174 geteuid=175 getgid=176 getegid=177 gettid=178 sysinfo=179 brk=214 munmap=215 mremap=216
            mmap=222 mprotect=226 madvise=233 getrandom=278 membarrier=283 rseq=293
        """),
        deadly=_calls("ptrace=117 socket=198 clone=220 execve=221 execveat=281"),
        clone3=435,
    ),
}


@dataclass(frozen=True, slots=True)
class Support:
    """What this kernel offers."""

    architecture: str
    landlock_abi: int
    """0 where Landlock is missing or switched off."""
    seccomp: bool

    @property
    def complete(self) -> bool:
        return self.landlock_abi > 0 and self.seccomp and self.architecture in _ARCHITECTURES

    def sentence(self) -> str:
        if self.complete:
            alone = "" if self.landlock_abi >= 6 else ", an older one: only seccomp blocks TCP or signals"
            return f"confinement works: seccomp and Landlock (ABI {self.landlock_abi}{alone}) on {self.architecture}"
        reasons = []
        if self.architecture not in _ARCHITECTURES:
            reasons.append(f"openeureka does not know the system calls of {sys.platform} on {self.architecture}")
        if not self.seccomp:
            reasons.append("the kernel offers no seccomp filter")
        if not self.landlock_abi:
            reasons.append("the kernel offers no Landlock (Linux 5.13 or later, `landlock` among its security modules)")
        return f"generated code cannot be confined: {'; '.join(reasons)}"


def _libc() -> ctypes.CDLL:
    return ctypes.CDLL(None, use_errno=True)


def support() -> Support:
    """Ask the kernel, changing nothing."""
    architecture = platform.machine()
    table = _ARCHITECTURES.get(architecture)
    if sys.platform != "linux" or table is None:
        return Support(architecture, 0, False)
    libc = _libc()
    abi = libc.syscall(_LANDLOCK_CREATE, None, ctypes.c_size_t(0), ctypes.c_uint32(_LANDLOCK_VERSION))
    action = ctypes.c_uint32(_KILL_PROCESS)
    available = libc.syscall(table.seccomp, _SECCOMP_GET_ACTION_AVAIL, 0, ctypes.byref(action))
    return Support(architecture, max(0, abi), available == 0)


def confine(*, kernel: bool = True) -> None:
    """Give up, in this process and for good, everything but computing and the open descriptors.

    Args:
        kernel: False leaves out Landlock and seccomp: limits and lost privileges only.

    Raises:
        OSError: when the kernel refuses a step; the caller must then end the process.
    """
    address_space = MEMORY_BYTES + _mapped_bytes()
    _drop_privileges()
    libc = _libc()
    if sys.platform == "linux":
        # Changing the user cleared the parent-death signal; set it again before anything can go wrong.
        _checked(libc.prctl(_PR_SET_PDEATHSIG, signal.SIGKILL, 0, 0, 0))
    if kernel:
        _checked(libc.prctl(_PR_SET_NO_NEW_PRIVS, 1, 0, 0, 0))
        _restrict_files(libc)
    _limit(address_space)
    if kernel:
        _filter_calls(libc, _ARCHITECTURES[platform.machine()])


def _checked(result: int) -> int:
    if result < 0:
        number = ctypes.get_errno()
        raise OSError(number, os.strerror(number))
    return result


def _drop_privileges() -> None:
    """As root, become a user that owns nothing, a different one for neighbouring processes; otherwise do nothing."""
    if os.geteuid() != 0 or _only_user():
        return
    span = _LAST_UNUSED_UID - _FIRST_UNUSED_UID
    user = _FIRST_UNUSED_UID + os.getpid() % span
    try:
        os.setgroups([])
        os.setresgid(user, user, user)
        os.setresuid(user, user, user)
    except OSError as error:
        advice = "start eureka as an ordinary user, or give root CAP_SETUID, CAP_SETGID and the user ids from 61000 on"
        raise OSError(error.errno, f"root cannot become another user here ({error.strerror}); {advice}") from None


def _only_user() -> bool:
    """Whether this user namespace has a single user, as `unshare -r` makes it. Its root cannot become another user, and
    owns nothing beyond what that user owns outside."""
    try:
        with open("/proc/self/uid_map") as file:
            return sum(int(line.split()[2]) for line in file) == 1
    except FileNotFoundError:  # a kernel without user namespaces
        return False


def _limit(address_space: int) -> None:
    for name, value in (
        (resource.RLIMIT_AS, address_space),
        (resource.RLIMIT_CPU, CPU_SECONDS),
        (resource.RLIMIT_FSIZE, 0),
        (resource.RLIMIT_NOFILE, 0),
        (resource.RLIMIT_CORE, 0),
        (resource.RLIMIT_NPROC, 0),
    ):
        _, hard = resource.getrlimit(name)
        value = value if hard == resource.RLIM_INFINITY else min(value, hard)
        resource.setrlimit(name, (value, value))


def _mapped_bytes() -> int:
    """Address space in use: torch maps gigabytes that it never touches."""
    with open("/proc/self/statm") as file:
        return int(file.read().split()[0]) * resource.getpagesize()


def _restrict_files(libc: ctypes.CDLL) -> None:
    """An empty Landlock ruleset: nothing in the file system, no TCP, no signal or abstract socket to the outside."""
    abi = support().landlock_abi
    files = (1 << (13 if abi < 2 else 14 if abi < 3 else 15 if abi < 5 else 16)) - 1
    network = 0b11 if abi >= 4 else 0
    scoped = 0b11 if abi >= 6 else 0
    size = 8 if abi < 4 else 16 if abi < 6 else 24
    attributes = struct.pack("<QQQ", files, network, scoped)[:size]
    ruleset = _checked(libc.syscall(_LANDLOCK_CREATE, attributes, ctypes.c_size_t(size), ctypes.c_uint32(0)))
    _checked(libc.syscall(_LANDLOCK_RESTRICT_SELF, ctypes.c_int(ruleset), ctypes.c_uint32(0)))
    os.close(ruleset)


class _Filter(ctypes.Structure):
    _fields_ = (("code", ctypes.c_ushort), ("jt", ctypes.c_ubyte), ("jf", ctypes.c_ubyte), ("k", ctypes.c_uint32))


class _Program(ctypes.Structure):
    _fields_ = (("length", ctypes.c_ushort), ("filter", ctypes.POINTER(_Filter)))


def _filter_calls(libc: ctypes.CDLL, table: _Architecture) -> None:
    """Install the filter: allowed calls pass, deadly ones kill, all others fail with EPERM."""
    load, equal, at_least, give = 0x20, 0x15, 0x35, 0x06  # BPF LD|W|ABS, JMP|JEQ|K, JMP|JGE|K, RET|K
    number, architecture = 0, 4  # offsets in struct seccomp_data
    code = [(load, 0, 0, architecture), (equal, 1, 0, table.audit), (give, 0, 0, _KILL_PROCESS), (load, 0, 0, number)]
    if table.x32_bit:
        code += [(at_least, 0, 1, table.x32_bit), (give, 0, 0, _KILL_PROCESS)]
    rules = ((table.allowed, _ALLOW), (table.deadly, _KILL_PROCESS), ((table.clone3,), _ERRNO | _ENOSYS))
    for calls, action in rules:
        for call in calls:
            code += [(equal, 0, 1, call), (give, 0, 0, action)]
    code.append((give, 0, 0, _ERRNO | _EPERM))
    filters = (_Filter * len(code))(*(_Filter(*line) for line in code))
    program = _Program(len(code), filters)
    _checked(libc.prctl(_PR_SET_SECCOMP, _SECCOMP_MODE_FILTER, ctypes.byref(program), 0, 0))
