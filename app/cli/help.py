"""Help of a subcommand: `--help` lists the options that matter on one screen, `--help-all` every option.

Both are written from the parser that reads the options, so they cannot differ from it.
"""

import re
import textwrap
from argparse import Action, ArgumentParser

ALL = "--help-all"
HELP = ("-h", "--help", ALL)
WIDTH, MOST_LINES = 80, 60
"""Columns of all help, and lines of `--help`."""
_COLUMN = 25
"""Columns before a description."""
_ENDING = re.compile(r"\s*\((?:default: (?P<default>[^()]*)|required)\)$")
_UNSAID = ("", "None", "False")
"""Defaults that say no more than that an option was not given."""


def format_help(parser: ArgumentParser, command: str, complete: bool = False) -> str:
    """Format the help of a subcommand; `complete` for every option with its whole description.

    Else descriptions end with their first sentence, and the last groups of options are left out where they do not fit.
    """
    groups = len(parser._action_groups)
    lines = _lines(parser, command, complete, groups)
    while not complete and groups and len(lines) > MOST_LINES:
        groups -= 1
        lines = _lines(parser, command, complete, groups)
    return "\n".join(lines)


def _lines(parser: ArgumentParser, command: str, complete: bool, groups: int) -> list[str]:
    """Lines of the help with the first `groups` of options besides the command's own."""
    positional, own, *others = parser._action_groups  # argparse has no public list of them
    arguments = positional._group_actions
    options = sorted((each for each in own._group_actions if each.dest != "help"), key=lambda each: each.dest == "json")
    sections = [
        ("arguments", "", arguments),
        ("options", "", [each for each in options if "." not in each.dest]),
        ("settings", "", [each for each in options if "." in each.dest]),
        *(((group.title or "").removesuffix(" options"), group.description or "", group._group_actions)
          for group in others),
    ]  # fmt: skip
    required = [_name(action) for action in (*arguments, *options) if action.required or action in arguments]
    lines = [" ".join([f"usage: nerfnav {command}", *required, "[OPTIONS]"])]
    for paragraph in (parser.description or "").split("\n\n"):
        if paragraph.strip("\n").startswith("  "):  # a line of a list
            lines += textwrap.wrap(paragraph.strip("\n"), WIDTH, subsequent_indent=" " * (_COLUMN + 2))
        else:
            lines += ["", *textwrap.wrap(paragraph, WIDTH)]
    for title, about, actions in sections[: 2 + groups]:
        if actions:
            heading = f"{title}: {about}" if complete and about else f"{title}:"
            lines += ["", *textwrap.wrap(heading, WIDTH), *_described(actions, complete)]
    if count := sum(len(actions) for _, _, actions in sections[2 + groups :]):
        lines += ["", f"{count} more options: nerfnav {command} {ALL}"]
    return lines


def _described(actions: list[Action], complete: bool) -> list[str]:
    """The name of each option and its description, in two columns."""
    lines: list[str] = []
    for action in actions:
        name, column = f"  {_name(action)}", " " * _COLUMN
        text = textwrap.wrap(_description(action, complete), WIDTH, initial_indent=column, subsequent_indent=column)
        if len(name) < _COLUMN and text:
            text[0] = name.ljust(_COLUMN) + text[0].lstrip()
        else:
            text.insert(0, name)
        lines += text
    return lines


def _name(action: Action) -> str:
    return " ".join([*action.option_strings[:1], _metavar(action)]).rstrip()


def _metavar(action: Action) -> str:
    """Format the value of an option as people know it: INT, not {None}|INT; draft|good|best, not {draft,good,best}."""
    if action.nargs == 0:
        return ""
    if action.choices is not None:
        return "|".join(each for each in str(action.metavar).strip("{}").split(",") if each != "None")
    metavar = str(action.metavar).replace("{None}|", "")
    metavar = re.sub(r"\[(\w+) \[\1 \.\.\.\]\]", r"\1 ...", metavar)
    path = "FOLDER" if str(action.help).startswith("Folder") else "FILE"
    return re.sub(r"\bSTR\b", "NAME", re.sub(r"\bPATH\b", path, metavar))


def _description(action: Action, complete: bool) -> str:
    """Description of an option, with its default where it has one."""
    text = " ".join((action.help or "").split())
    found = _ENDING.search(text)
    text, ending = (text[: found.start()], found["default"]) if found else (text, "")
    text = text if complete else re.split(r"(?<=\w|\)|`)\.\s(?=[A-Z0-9])", text, maxsplit=1)[0]
    text = text.removesuffix(".")
    if found and ending is None:
        return f"{text} (required)" if action.option_strings else text
    if ending in _UNSAID:
        return text
    return f"{text} (default: {'yes' if ending == 'True' else ending})"
