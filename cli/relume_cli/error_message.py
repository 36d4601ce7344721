"""Error messages of the command line: the parameter as typed, its value, and the allowed values."""

from __future__ import annotations

import re
from collections.abc import Sequence
from itertools import takewhile

from typer.exceptions import TyperException

from relume.core.errors import ParameterError

_INVALID = re.compile(r"Invalid value for '?(?P<name>[^':]+)'?: (?:Value error, )?(?P<why>.+?)\.?", re.DOTALL)
_NOT = re.compile(r"(?P<given>.+) is not (?P<allowed>one of .+|a valid .+|in the range .+)", re.DOTALL)
_MISSING = re.compile(r"Missing \w+ '(?P<name>[^']+)'")
_SHOULD = "Input should be "
_REWORDED = (
    (r"^a valid int(eger)?", "a whole number"),
    (r"^a valid (float|number)", "a number"),
    (r"^in the range (\d+)<=x<=(\d+)", r"a number from \1 to \2"),
    (r"^(in the range x>=|greater than or equal to )", "a number of at least "),
    (r"^(greater|less) than", r"a number \1 than"),
)


def error_message(error: Exception, arguments: Sequence[str] = ()) -> str:
    """Return the message of an error, in one line.

    Args:
        error: error of any kind. arguments: arguments of the command; the message names its options as typed.
    """
    from sqlalchemy.exc import DBAPIError

    from relume.core.errors import RelumeError
    from relume_worker.database.failures import describe_error

    if isinstance(error, TyperException):
        text = _usage(error, arguments)
    elif isinstance(error, ParameterError):
        text = str(_rename_to_option(error, arguments))
    elif isinstance(error, RelumeError):
        text = str(error)
    elif isinstance(error, OSError) and error.strerror:
        text = f"{error.filename}: {error.strerror}" if error.filename else error.strerror
    elif isinstance(error, DBAPIError):
        reason = describe_error(error)
        text = f"the database cannot be used ({reason}); check that it runs and that RELUME_DATABASE is its URL"
    elif isinstance(error, MemoryError):
        text = "out of memory; give a smaller size or fewer lights"
    else:
        text = f"{type(error).__name__}: {str(error) or 'internal error'}; --verbose shows the traceback"
    return " ".join(text.split())


def _rename_to_option(error: ParameterError, arguments: Sequence[str]) -> ParameterError:
    """Return the error with the option's name, if the option was typed."""
    typed_options = {argument.partition("=")[0] for argument in arguments}
    option = "--" + error.name.replace("_", "-")
    for spelling in (option, option.removesuffix("s")):  # `views` is given by one --view each
        if spelling in typed_options:
            return ParameterError(spelling, error.value, error.allowed)
    return error


def _usage(error: TyperException, arguments: Sequence[str]) -> str:
    """Reword the command-line parser's message like all other errors."""
    text = error.format_message() or "no command given; see relume --help"
    if (missing_match := _MISSING.match(text)) is not None:
        return f"{missing_match['name']} is missing; see {_command(arguments)} --help"
    if text.startswith("No such command"):
        return f"{text.removesuffix('.')}; see relume --help"
    invalid = _INVALID.fullmatch(text)
    if invalid is None:
        return text
    name, reason = invalid["name"], invalid["why"]
    if (limited := _NOT.fullmatch(reason)) is not None:
        return f"{name} is {limited['given']}; give {_allowed(limited['allowed'])}"
    if not reason.startswith(_SHOULD):
        return f"{name}: {reason}"
    allowed = _allowed(reason.removeprefix(_SHOULD).partition(", unable")[0])
    return f"{name} is {_find_argument_value(name, arguments)!r}; give {allowed}"


def _allowed(text: str) -> str:
    """Reword the allowed values of the parser."""
    for pattern, replacement in _REWORDED:
        text = re.sub(pattern, replacement, text)
    return text


def _command(arguments: Sequence[str]) -> str:
    """The command as typed, without its arguments."""
    return " ".join(["relume", *takewhile(lambda word: not word.startswith("-"), arguments[:1])])


def _find_argument_value(option: str, arguments: Sequence[str]) -> str:
    """Return the last value given for an option."""
    last_value = ""
    for argument, next_argument in zip(arguments, [*arguments[1:], ""], strict=True):
        name, is_joined, value = argument.partition("=")
        if name == option:
            last_value = value if is_joined else next_argument
    return last_value
