"""Reads what a view hands to its page, by other code than the page's."""

import base64
import gzip
import json

import numpy as np

DTYPES = {"u1": "u1", "u2": "<u2", "u4": "<u4", "i4": "<i4", "f4": "<f4"}


def read_script(text):
    """Head and arrays of a script."""
    data = json.loads(text.partition("=")[2].removesuffix(";\n"))
    block = gzip.decompress(base64.b64decode(data["packed"]))
    arrays = {}
    for name, (kind, begin, count) in data["arrays"].items():
        arrays[name] = np.frombuffer(block, DTYPES[kind], count, begin)
    return data["head"], arrays
