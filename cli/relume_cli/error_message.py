"""A failure as people read it: the name of what is wrong as it was typed, what was given, and what is allowed."""

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


def error_message(error: Exception, arguments: Sequence[str] = ()) -> str:
    """What went wrong, in one line.

    Args:
        error: of any kind. arguments: of the command, whose options are called as they were typed.
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
        text = f"the database cannot be used ({reason}); see that it runs, and that RELUME_DATABASE names it"
    elif isinstance(error, MemoryError):
        text = "out of memory; take a smaller size or fewer lights"
    else:
        text = f"{type(error).__name__}: {str(error) or 'a defect'}; --verbose shows the trace"
    return " ".join(text.split())


def _rename_to_option(error: ParameterError, arguments: Sequence[str]) -> ParameterError:
    """The same, of a parameter that an option was given for, by the name of the option."""
    typed_options = {argument.partition("=")[0] for argument in arguments}
    option = "--" + error.name.replace("_", "-")
    for spelling in (option, option.removesuffix("s")):  # of several views each is given by an option of its own
        if spelling in typed_options:
            return ParameterError(spelling, error.value, error.allowed)
    return error


def _usage(error: TyperException, arguments: Sequence[str]) -> str:
    """What the parser of the command line says, in the words of all other failures."""
    text = error.format_message() or "nothing to do; see relume --help"
    if (missing_match := _MISSING.match(text)) is not None:
        return f"{missing_match['name']} is missing; give it, as {_command(arguments)} --help says"
    invalid = _INVALID.fullmatch(text)
    if invalid is None:
        return text
    name, reason = invalid["name"], invalid["why"]
    if (limited := _NOT.fullmatch(reason)) is not None:
        allowed = re.sub(r"^in the", "a number in the", limited["allowed"]).replace("valid int", "valid integer")
        return f"{name} is {limited['given']}; give {allowed}"
    allowed = re.sub(
        r"^(greater|less) than", r"a number \1 than", reason.removeprefix(_SHOULD).partition(", unable")[0]
    )
    return (
        f"{name} is {_find_argument_value(name, arguments)!r}; give {allowed}"
        if reason.startswith(_SHOULD)
        else f"{name}: {reason}"
    )


def _command(arguments: Sequence[str]) -> str:
    """The command as it was typed, without what follows its name."""
    return " ".join(["relume", *takewhile(lambda word: not word.startswith("-"), arguments[:1])])


def _find_argument_value(option: str, arguments: Sequence[str]) -> str:
    """What was given for an option; the last one counts."""
    last_value = ""
    for argument, next_argument in zip(arguments, [*arguments[1:], ""], strict=True):
        name, is_joined, value = argument.partition("=")
        if name == option:
            last_value = value if is_joined else next_argument
    return last_value
