#!/usr/bin/env python3
"""Folders of host_tools and who may see whom.

  layers.py [ROOT]           checks: no cycle among the folders, every include along a link, the drawing in the docs, and that
                             only sources of effects/ include the catalogue: a new effect compiles nothing else again
  layers.py --draw [ROOT]    the folders from the ground up, each with what its CMakeLists.txt links

An arrow is an #include of another folder's header. Links are those of CMake: fxdyn_layer(NAME .. LINKS ..) and
target_link_libraries(.. fxdyn_NAME ..). That the compiler sees no more than the links is layers.cmake's business.
"""
import argparse
import pathlib
import re
import sys

INCLUDE = re.compile(r'^\s*#include "host_tools/(\w+)/[^"]*"', re.M)
LAYER = re.compile(r'fxdyn_layer\(\s*(\w+)([^)]*)\)')
TYPES = re.compile(r'^#include "(model/(?:catalogue|joint_model)\.hpp)"', re.M)
DOCUMENT = 'docs/decisions/0007-layers.md'
TARGETS = {'dictionary_files': 'dictionary'}  # where a target has another name than its folder


def folders_of(root):
    return sorted(p.name for p in (root / 'host_tools').iterdir() if (p / 'CMakeLists.txt').exists())


def includes_of(root):
    """(file, folder, folder that it includes)"""
    for path in sorted((root / 'host_tools').glob('*/*')):
        if path.suffix in ('.hpp', '.cpp'):
            for match in INCLUDE.finditer(path.read_text()):
                if match.group(1) != path.parent.name:
                    yield path.relative_to(root), path.parent.name, match.group(1)


def catalogue_includes_of(root):
    """Lines, one for each file that must not know the types of the catalogue"""
    for path in sorted((root / 'host_tools').glob('*/*.?pp')):
        if path.parent.name == 'effects' and path.suffix == '.cpp':
            continue
        text = re.sub(r'R"\((.*?)\)"', '', path.read_text(), flags=re.S)  # what is written into generated files
        for match in TYPES.finditer(text):
            yield f'{path.relative_to(root)}: includes {match.group(1)}, which only sources of effects/ may'


def links_of(root):
    """folder -> folders that it links"""
    links = {}
    for folder in folders_of(root):
        text = re.sub(r'#.*', '', (root / 'host_tools' / folder / 'CMakeLists.txt').read_text())
        named = re.findall(r'\bfxdyn_(\w+)', ' '.join(m.group(2) for m in LAYER.finditer(text)))
        for match in re.finditer(r'target_link_libraries\(([^)]*)\)', text):
            named += re.findall(r'\bfxdyn_(\w+)', match.group(1))
        linked = {TARGETS.get(name, name) for name in named} & set(folders_of(root))
        links[folder] = linked - {folder}
    return links


def reachable(links, folder):
    seen, todo = set(), [folder]
    while todo:
        for other in links.get(todo.pop(), ()):
            if other not in seen:
                seen.add(other)
                todo.append(other)
    return seen


def complaints(includes, links):
    """Lines, one for each include that no link allows, and one for each cycle."""
    lines = []
    for file, folder, other in includes:
        if other not in reachable(links, folder):
            lines.append(f'{file}: includes {other}, which {folder} does not link (host_tools/{folder}/CMakeLists.txt)')
    arrows = {}
    for _, folder, other in includes:
        arrows.setdefault(folder, set()).add(other)
    for graph, name in ((arrows, 'include'), (links, 'link')):
        inside = sorted(f for f in graph if f in reachable(graph, f))
        if inside:
            lines.append(f'{name} cycle among: {" ".join(inside)}')
    return lines


def drawing(links):
    """From the ground up: a folder stands above all that it links."""
    height = {}
    def height_of(folder):
        if folder not in height:
            height[folder] = 1 + max((height_of(o) for o in links[folder]), default=-1)
        return height[folder]
    rows = {}
    for folder in links:
        rows.setdefault(height_of(folder), []).append(folder)
    lines = []
    for level in sorted(rows, reverse=True):
        for folder in sorted(rows[level]):
            direct = {o for o in links[folder] if not any(o in reachable(links, p) for p in links[folder] if p != o)}
            lines.append(f'{level}  {folder:<11} {"<- " + ", ".join(sorted(direct)) if direct else ""}'.rstrip())
    return '\n'.join(lines)


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument('--draw', action='store_true')
    parser.add_argument('root', nargs='?', type=pathlib.Path, default=pathlib.Path(__file__).resolve().parents[2])
    options = parser.parse_args()
    links = links_of(options.root)
    if options.draw:
        print(drawing(links))
        return 0
    found = complaints(list(includes_of(options.root)), links) + list(catalogue_includes_of(options.root))
    if drawing(links) not in (options.root / DOCUMENT).read_text():
        found.append(f'{DOCUMENT}: the drawing is not that of the links; copy what layers.py --draw prints')
    print('\n'.join(found) or f'{len(links)} folders, no cycle, every include along a link')
    return 1 if found else 0


if __name__ == '__main__':
    sys.exit(main())
