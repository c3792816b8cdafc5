#!/usr/bin/env python3
"""compiled.py on output made up for it."""
import sys
import unittest

sys.dont_write_bytecode = True
import compiled

COMMANDS = """/usr/bin/c++ -I /root/a -o a/x.o -c /root/a/x.cpp
: && /usr/bin/c++ a/x.o -o x
/usr/bin/c++ -o b/y.o -c /root/b/y.cpp
"""
DEPS = """a/x.o: #deps 2, deps mtime 1 (VALID)
    ../../a/x.cpp
    ../../a/h.hpp

b/y.o: #deps 3, deps mtime 1 (VALID)
    ../../b/y.cpp
    ../../a/h.hpp
    ../../a/other_h.hpp
"""


class Compiled(unittest.TestCase):
    def test_links_are_no_compiles(self):
        self.assertEqual(compiled.for_target(COMMANDS), 2)

    def test_objects_that_read_a_header(self):
        self.assertEqual(compiled.after_change(DEPS, 'a/h.hpp'), {'a': 1, 'b': 1})
        self.assertEqual(compiled.after_change(DEPS, 'a/other_h.hpp'), {'b': 1})

    def test_a_source_is_read_by_its_own_object(self):
        self.assertEqual(compiled.after_change(DEPS, 'b/y.cpp'), {'b': 1})

    def test_a_file_is_the_end_of_a_path(self):
        self.assertEqual(compiled.after_change(DEPS, 'h.hpp'), {'a': 1, 'b': 1})
        self.assertEqual(compiled.after_change(DEPS, 'r_h.hpp'), {})

    def test_sources_reach_a_header_through_headers(self):
        includes = {'model/e.hpp': [], 'host_tools/a/h.hpp': ['model/e.hpp'], 'host_tools/a/x.cpp': ['host_tools/a/h.hpp'],
                    'host_tools/b/y.cpp': ['model/e.hpp', '<vector>'], 'host_tools/b/z.cpp': [], 'hal/w.cpp': ['model/e.hpp']}
        self.assertEqual(compiled.sources_with(includes, 'model/e.hpp'), ['host_tools/a/x.cpp', 'host_tools/b/y.cpp'])
        self.assertEqual(compiled.sources_with(includes, 'host_tools/b/z.cpp'), ['host_tools/b/z.cpp'])

    def test_a_missed_goal_is_named(self):
        self.assertEqual(compiled.misses([('a', 20, 20), ('b', 21, 20)]), ['b: 21 files, more than 20'])


if __name__ == '__main__':
    unittest.main()
