#!/usr/bin/env python3
"""A project whose scenario has its vibration at another frequency, for the figures of docs/findings.

  other_frequency.py PROJECT.toml HZ FOLDER     writes FOLDER/project.toml and FOLDER/scenario.toml

The swarms are cut to one particle pair and one generation: no figure of this project is of a BLS that a swarm searched.
"""
import pathlib
import re
import sys


def replaced(pattern, by, text, what):
    text, count = re.subn(pattern, by, text)
    if count == 0:
        sys.exit(f'other_frequency.py: there is no {what} to replace')
    return text


def main():
    project = pathlib.Path(sys.argv[1]).resolve()
    frequency, out = float(sys.argv[2]), pathlib.Path(sys.argv[3])
    text = project.read_text()
    names = set(re.findall(r'^scenario = "([^"]+)"', text, re.M))
    if len(names) != 1:
        sys.exit(f'other_frequency.py: {project}: logs of one scenario are wanted, these are of {len(names)}')
    scenario = (project.parent / names.pop()).read_text()

    def with_urdf(content):
        return replaced(r'(?m)^urdf = "([^"]+)"', lambda m: f'urdf = "{(project.parent / m.group(1)).resolve()}"', content, 'urdf')

    scenario = replaced(r'frequency_hz = [0-9.]+', f'frequency_hz = {frequency}', with_urdf(scenario), 'frequency_hz')
    text = replaced(r'(?m)^scenario = "[^"]+"', 'scenario = "scenario.toml"', with_urdf(text), 'scenario')
    text = replaced(r'(?m)^particles = \d+', 'particles = 2', text, 'particles')
    text = replaced(r'(?m)^iterations = \d+', 'iterations = 1', text, 'iterations')
    out.mkdir(parents=True, exist_ok=True)
    (out / 'project.toml').write_text(text)
    (out / 'scenario.toml').write_text(scenario)
    return 0


if __name__ == '__main__':
    sys.exit(main())
