#!/usr/bin/env python3
"""layers.py on trees made up for it."""
import pathlib
import sys
import tempfile
import unittest

sys.dont_write_bytecode = True
import layers


def tree(directory, files):
    root = pathlib.Path(directory)
    for name, text in files.items():
        path = root / 'host_tools' / name
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_text(text)
    return root


def found(files):
    with tempfile.TemporaryDirectory() as directory:
        root = tree(directory, files)
        return layers.complaints(list(layers.includes_of(root)), layers.links_of(root))


GROUND = 'fxdyn_layer(ground SOURCES a.cpp LINKS Eigen3::Eigen)'
MIDDLE = 'fxdyn_layer(middle\n  SOURCES b.cpp\n  LINKS fxdyn_ground)'


class Layers(unittest.TestCase):
    def test_an_include_along_a_link_is_right(self):
        self.assertEqual(found({'ground/CMakeLists.txt': GROUND, 'middle/CMakeLists.txt': MIDDLE, 'ground/a.hpp': '',
                                'middle/b.cpp': '#include "host_tools/ground/a.hpp"\n'}), [])

    def test_a_link_is_inherited(self):
        self.assertEqual(found({'ground/CMakeLists.txt': GROUND, 'middle/CMakeLists.txt': MIDDLE,
                                'top/CMakeLists.txt': 'fxdyn_layer(top SOURCES c.cpp LINKS fxdyn_middle)',
                                'top/c.cpp': '#include "host_tools/ground/a.hpp"\n'}), [])

    def test_an_include_against_the_arrows_is_named(self):
        lines = found({'ground/CMakeLists.txt': GROUND, 'middle/CMakeLists.txt': MIDDLE,
                       'ground/a.cpp': '#include "host_tools/middle/b.hpp"\n'})
        self.assertEqual(lines, ['host_tools/ground/a.cpp: includes middle, which ground does not link '
                                 '(host_tools/ground/CMakeLists.txt)'])

    def test_a_cycle_is_named(self):
        lines = found({'ground/CMakeLists.txt': 'fxdyn_layer(ground SOURCES a.cpp LINKS fxdyn_middle)',
                       'middle/CMakeLists.txt': MIDDLE, 'ground/a.cpp': '#include "host_tools/middle/b.hpp"\n',
                       'middle/b.cpp': '#include "host_tools/ground/a.hpp"\n'})
        self.assertEqual(lines, ['include cycle among: ground middle', 'link cycle among: ground middle'])

    def test_only_sources_of_effects_know_the_catalogue(self):
        include = '#include "model/catalogue.hpp"\n'
        with tempfile.TemporaryDirectory() as directory:
            root = tree(directory, {'effects/a.cpp': include, 'effects/a.hpp': include, 'ground/b.cpp': include,
                                    'ground/c.cpp': f'auto text = R"({include})";'})
            self.assertEqual([line.split(':')[0] for line in layers.catalogue_includes_of(root)],
                             ['host_tools/effects/a.hpp', 'host_tools/ground/b.cpp'])

    def test_what_is_drawn_stands_on_what_it_links(self):
        self.assertEqual(layers.drawing({'a': set(), 'b': {'a'}, 'c': {'a', 'b'}}),
                         '2  c           <- b\n1  b           <- a\n0  a')


if __name__ == '__main__':
    unittest.main()
