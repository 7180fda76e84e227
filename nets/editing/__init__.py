"""Editing a net file: the text stays the file, and only what is edited in it changes.

`edits` says what can be done to a net (a place more, an arc, another owner) and does it to the text; `yaml_text`
changes single entries of a YAML text where they stand, so comments, order and alignment of everything else stay as
they were; `net_file` is the file on the disk, which is written whole, and only where it is still what was read.

Whether the new text is a net is not judged here: it is read again by `firable.nets.text`, as if somebody had typed it.
"""
