"""``pamid completion``: a script that lets a shell complete commands, options and choices."""

import argparse
from typing import Any

from ..common import add_command, print_json

_DESCRIPTION = """\
Print a script with which a shell completes the names of commands and options, and the choices of an option; for
everything else it offers files. The script matches the installed version: print it again after an update.
"""
_EXAMPLES = """\
  pamid completion bash > ~/.local/share/bash-completion/completions/pamid
  pamid completion zsh > ~/.zfunc/_pamid                  and: fpath+=~/.zfunc; autoload -U compinit; compinit
  pamid completion fish > ~/.config/fish/completions/pamid.fish
"""


def add_parser(subparsers: Any) -> None:
    """Add the command."""
    parser = add_command(subparsers, "completion", "print a script for shell completion", _DESCRIPTION, _EXAMPLES)
    parser.add_argument("shell", choices=("bash", "zsh", "fish"), help="shell to print it for")


def run(args: argparse.Namespace) -> int:
    """Run the command."""
    from ..app import build_parser

    text = {"bash": _bash, "zsh": _zsh, "fish": _fish}[args.shell](_known(build_parser()))
    if args.json:
        print_json({"shell": args.shell, "script": text})
    else:
        print(text, end="")
    return 0


Options = list[tuple[str, str, list[str], bool]]
"""Of each option its name, its help, its choices, and whether it takes a value."""


def _known(parser: argparse.ArgumentParser) -> dict[str, tuple[str, Options]]:
    """Return help and options of every command; positional choices come without a name."""
    (group,) = (a for a in parser._actions if isinstance(a, argparse._SubParsersAction))
    helps = {a.dest: a.help or "" for a in group._choices_actions}
    found = {}
    for name, sub in group.choices.items():
        options: Options = []
        for action in sub._actions:
            choices = [str(c) for c in action.choices or ()]
            for flag in action.option_strings or ([""] if choices else []):
                options.append((flag, _one_line(action.help or ""), choices, action.nargs != 0))
        found[name] = (helps.get(name, ""), options)
    return found


def _one_line(text: str) -> str:
    return " ".join(text.split()).replace("'", "’").replace("[", "(").replace("]", ")").replace(":", " -")


def _bash(known: dict[str, tuple[str, Options]]) -> str:
    words, values = [], []
    for name, (_, options) in known.items():
        flags = " ".join([f for f, *_ in options if f] + [c for f, _, cs, _ in options if not f for c in cs])
        words.append(f"    {name}) words='{flags}' ;;")
        for flag, _, choices, takes in options:
            if flag and choices:
                values.append(f"    {name}:{flag}) words='{' '.join(choices)}'; takes=1 ;;")
            elif flag and takes:
                values.append(f"    {name}:{flag}) takes=1 ;;")
    lines = "\n".join
    return f"""# Completion of pamid for bash; written by 'pamid completion bash'.
_pamid() {{
  local current="${{COMP_WORDS[COMP_CWORD]}}" before="${{COMP_WORDS[COMP_CWORD-1]}}" words='' takes=''
  COMPREPLY=()
  if [ "$COMP_CWORD" -eq 1 ]; then
    COMPREPLY=( $(compgen -W '{" ".join(known)} --help --version' -- "$current") )
    return
  fi
  case "${{COMP_WORDS[1]}}:$before" in
{lines(values)}
  esac
  if [ -n "$takes" ]; then
    if [ -n "$words" ]; then
      COMPREPLY=( $(compgen -W "$words" -- "$current") )
    else
      COMPREPLY=( $(compgen -f -- "$current") )
    fi
    return
  fi
  case "${{COMP_WORDS[1]}}" in
{lines(words)}
  esac
  case "$current" in
    -*) COMPREPLY=( $(compgen -W "$words" -- "$current") ) ;;
    *) COMPREPLY=( $(compgen -W "$words" -- "$current") $(compgen -f -- "$current") ) ;;
  esac
}}
complete -o filenames -F _pamid pamid
"""


def _zsh(known: dict[str, tuple[str, Options]]) -> str:
    listed = "\n".join(f"    '{name}:{_one_line(text)}'" for name, (text, _) in known.items())
    cases = []
    for name, (_, options) in known.items():
        specs = []
        for flag, text, choices, takes in options:
            among = f"({' '.join(choices)})" if choices else "_files"
            if not flag:
                specs.append(f"'1:choice:{among}'")
            elif takes:
                specs.append(f"'*{flag}[{text}]:value:{among}'")
            else:
                specs.append(f"'{flag}[{text}]'")
        specs.append("'*:file:_files'")
        cases.append(f"    {name}) _arguments {' '.join(specs)} ;;")
    lines = "\n".join(cases)
    return f"""#compdef pamid
# Completion of pamid for zsh; written by 'pamid completion zsh'.
_pamid() {{
  local -a commands
  commands=(
{listed}
  )
  if (( CURRENT == 2 )); then
    _describe command commands
    return
  fi
  local command=$words[2]
  shift words
  (( CURRENT-- ))
  case $command in
{lines}
  esac
}}
if [ "$funcstack[1]" = "_pamid" ]; then
  _pamid "$@"
else
  compdef _pamid pamid
fi
"""


def _fish(known: dict[str, tuple[str, Options]]) -> str:
    lines = ["# Completion of pamid for fish; written by 'pamid completion fish'."]
    lines.append("complete -c pamid -n __fish_use_subcommand -l version -d 'show the version'")
    for name, (text, options) in known.items():
        lines.append(f"complete -c pamid -n __fish_use_subcommand -f -a {name} -d '{_one_line(text)}'")
        when = f"-n '__fish_seen_subcommand_from {name}'"
        for flag, words, choices, takes in options:
            among = f" -x -a '{' '.join(choices)}'" if choices else " -r" if takes else ""
            if not flag:
                lines.append(f"complete -c pamid {when} -f -a '{' '.join(choices)}'")
            else:
                dash = f"-l {flag[2:]}" if flag.startswith("--") else f"-s {flag[1:]}"
                lines.append(f"complete -c pamid {when} {dash}{among} -d '{words}'")
    return "\n".join(lines) + "\n"
