"""The error tree in the docstring and the classes are one thing."""

import re

import fusion
import fusion.errors
from fusion import FusionError


def leaves():
    return [
        one
        for one in vars(fusion.errors).values()
        if isinstance(one, type) and issubclass(one, FusionError) and one is not FusionError
    ]


def test_drawing_of_the_error_tree_names_every_class():
    drawn = re.findall(r"[├└]── (\w+) ", fusion.errors.__doc__)
    assert sorted(drawn) == sorted(leaf.__name__ for leaf in leaves())


def test_every_error_is_public():
    assert {leaf.__name__ for leaf in leaves()} | {"FusionError"} <= set(fusion.__all__)
