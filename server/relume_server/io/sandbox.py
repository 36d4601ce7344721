"""What a process that reads a stranger's file may do: read the program and its own files, write into one folder.

Landlock keeps it from all other files, and seccomp from sockets, other programs and other processes. Both hold for a
process that nobody gave any right, in a container, too. Where a kernel lacks one of them the process goes on with the
other, and `missing` says so.
"""

from __future__ import annotations

import errno
import os
import sys
import tempfile
from collections.abc import Sequence
from contextlib import suppress
from functools import cache
from pathlib import Path

from relume.core.numba_cache import cache_folder, disable_kernel_saving

_PACKAGES = ("relume", "relume_worker", "relume_server")
_SYSTEM = ("/usr", "/lib", "/lib64", "/bin", "/etc/ld.so.cache", "/etc/localtime", "/dev/null", "/dev/urandom")
# What no reader of a file needs: sockets, other programs, other processes, and ways around these rules.
_REFUSED_CALLS = (
    "socket", "socketpair", "connect", "bind", "sendto", "sendmsg", "sendmmsg",
    "execve", "execveat", "ptrace", "process_vm_readv", "process_vm_writev", "pidfd_getfd", "pidfd_open",
    "io_uring_setup", "bpf", "perf_event_open", "userfaultfd", "unshare", "setns", "mount", "keyctl", "add_key",
)  # fmt: skip


def confine(readable: Sequence[Path], writable_folder: Path) -> None:
    """Give up what reading files does not need; for good, and for all that this process starts.

    Args:
        readable: files and folders that it may read. writable_folder: folder that it may write to, temporary files too.
    """
    tempfile.tempdir = str(writable_folder)
    disable_kernel_saving()
    with suppress(OSError):  # if memory is short, this process goes first
        Path("/proc/self/oom_score_adj").write_text("1000")
    has_landlock, has_seccomp = _has_landlock(), _has_seccomp()  # what they look for cannot be found afterwards
    if has_landlock:
        _restrict_files(readable, writable_folder)
    if has_seccomp:
        _restrict_syscalls()


@cache
def missing_features() -> tuple[str, ...]:
    """What this machine cannot do of it, by name."""
    features = (("Landlock", _has_landlock()), ("seccomp", _has_seccomp()))
    return tuple(name for name, is_available in features if not is_available)


@cache
def _has_landlock() -> bool:
    try:
        from landlockpy import Ruleset
        from landlockpy.errors import LandlockError

        try:
            Ruleset().close()
        except LandlockError:
            return False
    except ImportError:  # not on this system
        return False
    return True


@cache
def _has_seccomp() -> bool:
    try:
        import pyseccomp

        pyseccomp.SyscallFilter(pyseccomp.ALLOW)
    except (ImportError, RuntimeError, OSError, AttributeError):  # not on this system, or without libseccomp
        return False
    return True


def _restrict_files(readable: Sequence[Path], writable_folder: Path) -> None:
    from landlockpy import AccessFS, Ruleset, Scope

    read = AccessFS.READ_FILE | AccessFS.READ_DIR
    write = read | AccessFS.WRITE_FILE | AccessFS.TRUNCATE | AccessFS.REFER
    write |= AccessFS.MAKE_REG | AccessFS.MAKE_DIR | AccessFS.REMOVE_FILE | AccessFS.REMOVE_DIR
    with Ruleset(scoped=Scope.ABSTRACT_UNIX_SOCKET | Scope.SIGNAL) as rules:
        for path in _program():
            rules.allow_path(path, (read | AccessFS.EXECUTE) if path.is_dir() else AccessFS.READ_FILE)
        for path in filter(Path.exists, readable):  # what has gone meanwhile its reader misses in words
            rules.allow_path(path, read if path.is_dir() else AccessFS.READ_FILE)
        rules.allow_path(writable_folder, write)
        rules.restrict()


@cache
def _program() -> tuple[Path, ...]:
    """Where the interpreter, the packages and the compiled kernels lie."""
    roots = [Path(sys.prefix), Path(sys.base_prefix), *map(Path, _SYSTEM)]
    roots += [Path(entry) for entry in sys.path if Path(entry).name in ("site-packages", "dist-packages")]
    roots += [Path(sys.modules[name].__path__[0]) for name in _PACKAGES if name in sys.modules]
    roots.append(cache_folder())
    return tuple(root for root in roots if root.exists())


def _restrict_syscalls() -> None:
    import pyseccomp

    rules = pyseccomp.SyscallFilter(pyseccomp.ALLOW)
    for name in _REFUSED_CALLS:
        with suppress(OSError, ValueError):  # a call that this machine does not know
            rules.add_rule(pyseccomp.ERRNO(errno.EPERM), name)
    rules.load()


def environment() -> dict[str, str]:
    """What of this process's environment such a process is given: nothing that could be a password or a key."""
    return {name: os.environ[name] for name in _ENVIRONMENT if name in os.environ}


_ENVIRONMENT = (
    "PATH", "HOME", "LANG", "LC_ALL", "LC_CTYPE", "TZ", "TMPDIR", "XDG_CACHE_HOME", "LD_LIBRARY_PATH", "VIRTUAL_ENV",
    "PYTHONPATH", "PYTHONHOME", "PYTHONDONTWRITEBYTECODE", "PYTHONUNBUFFERED", "PYTHONWARNINGS",
    "NUMBA_CACHE_DIR", "NUMBA_CPU_NAME",
)  # fmt: skip
"""Names of variables that say where the program lies and how it speaks."""
