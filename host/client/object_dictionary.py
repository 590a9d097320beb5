"""Give the canopen library the object dictionary that all nodes share."""

import io
from functools import cache

from canopen.objectdictionary import ObjectDictionary, eds

from steptwin.protocol.eds import render_eds
from steptwin.protocol.frame import FIRST_NODE_ID


@cache
def object_dictionary() -> ObjectDictionary:
    """Return the dictionary; it is made once, since that takes 40 ms, and nothing writes to it."""
    dictionary: ObjectDictionary = eds.import_eds(io.StringIO(render_eds()), FIRST_NODE_ID)  # type: ignore[no-untyped-call]
    return dictionary
