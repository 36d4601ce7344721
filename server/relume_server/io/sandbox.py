"""Sandbox of processes that read uploaded files: read the program and the input, write into one folder.

Landlock blocks all other files, and seccomp blocks sockets, other programs and other processes. Both work without
privileges, in containers as well. If a kernel lacks one, the process runs with the other, and `missing_features`
reports it.
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
# System calls that readers do not need: sockets, other programs and processes, and ways around these rules.
_REFUSED_CALLS = (
    "socket", "socketpair", "connect", "bind", "sendto", "sendmsg", "sendmmsg",
    "execve", "execveat", "ptrace", "process_vm_readv", "process_vm_writev", "pidfd_getfd", "pidfd_open",
    "io_uring_setup", "bpf", "perf_event_open", "userfaultfd", "unshare", "setns", "mount", "keyctl", "add_key",
)  # fmt: skip


def confine(readable: Sequence[Path], writable_folder: Path) -> None:
    """Enter the sandbox, permanently and for all child processes.

    Args:
        readable: files and folders to read. writable_folder: folder to write to, also for temporary files.
    """
    tempfile.tempdir = str(writable_folder)
    disable_kernel_saving()
    with suppress(OSError):  # if memory is short, kill this process first
        Path("/proc/self/oom_score_adj").write_text("1000")
    has_landlock, has_seccomp = _has_landlock(), _has_seccomp()  # cannot be found inside the sandbox
    if has_landlock:
        _restrict_files(readable, writable_folder)
    if has_seccomp:
        _restrict_syscalls()


@cache
def missing_features() -> tuple[str, ...]:
    """Sandbox features that this machine lacks, by name."""
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
        for path in filter(Path.exists, readable):  # a file deleted meanwhile is reported by its reader
            rules.allow_path(path, read if path.is_dir() else AccessFS.READ_FILE)
        rules.allow_path(writable_folder, write)
        rules.restrict()


@cache
def _program() -> tuple[Path, ...]:
    """Folders of the interpreter, the packages and the compiled kernels."""
    roots = [Path(sys.prefix), Path(sys.base_prefix), *map(Path, _SYSTEM)]
    roots += [Path(entry) for entry in sys.path if Path(entry).name in ("site-packages", "dist-packages")]
    roots += [Path(sys.modules[name].__path__[0]) for name in _PACKAGES if name in sys.modules]
    roots.append(cache_folder())
    return tuple(root for root in roots if root.exists())


def _restrict_syscalls() -> None:
    import pyseccomp

    rules = pyseccomp.SyscallFilter(pyseccomp.ALLOW)
    for name in _REFUSED_CALLS:
        with suppress(OSError, ValueError):  # unknown on this machine
            rules.add_rule(pyseccomp.ERRNO(errno.EPERM), name)
    rules.load()


def environment() -> dict[str, str]:
    """Environment variables for such a process: none that could contain a password or key."""
    return {name: os.environ[name] for name in _ENVIRONMENT if name in os.environ}


_ENVIRONMENT = (
    "PATH", "HOME", "LANG", "LC_ALL", "LC_CTYPE", "TZ", "TMPDIR", "XDG_CACHE_HOME", "LD_LIBRARY_PATH", "VIRTUAL_ENV",
    "PYTHONPATH", "PYTHONHOME", "PYTHONDONTWRITEBYTECODE", "PYTHONUNBUFFERED", "PYTHONWARNINGS",
    "NUMBA_CACHE_DIR", "NUMBA_CPU_NAME",
)  # fmt: skip
"""Variables with paths of the program, and its language."""
