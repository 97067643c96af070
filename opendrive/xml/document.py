"""Files to XML elements, safely.

No entity is expanded, no document type or include followed, no network used; size, number of tags, depth and
length of texts are limited, so that no file takes unbounded time or memory.
"""

from pathlib import Path

from lxml import etree

from opendrive.errors import MapReadError

MAX_FILE_BYTES = 256 * 2**20
MAX_TAGS = 5_000_000
"""A file with more tags is refused; a real map of 200 MB has 4 million."""


def parse(file: Path, data: bytes) -> etree._Element:
    """Return the root element of a map.

    Args:
        file: its file, for messages.
        data: content of the file; see `read_bytes`.

    Raises:
        MapReadError: it is not well-formed XML or not OpenDRIVE.
    """
    parser = etree.XMLParser(
        resolve_entities=False,
        no_network=True,
        load_dtd=False,
        huge_tree=False,
        collect_ids=False,
        remove_blank_text=True,
        remove_comments=True,
        remove_pis=True,
    )
    try:
        root = etree.fromstring(data, parser)
    except (etree.XMLSyntaxError, ValueError) as error:
        if isinstance(error, MapReadError):
            raise
        reason = str(error).replace("\n", " ")[:200]
        raise MapReadError(
            f"{file}: not well-formed XML ({reason}); the file is truncated, damaged or not OpenDRIVE",
            "asam.net:xodr:1.0.0:xml.valid_xml_document",
        ) from error
    if root.getroottree().docinfo.internalDTD is not None:
        raise MapReadError(f"{file}: declares a document type (DOCTYPE), which maps never need; remove it")
    if str(root.tag).startswith("{"):
        for element in root.iter(etree.Element):
            element.tag = etree.QName(element).localname
        etree.cleanup_namespaces(root)
    if root.tag != "OpenDRIVE":
        raise MapReadError(
            f"{file}: the root element is <{root.tag!s:.80}>, expected <OpenDRIVE>; give an OpenDRIVE file",
            "asam.net:xodr:1.0.0:xml.root_tag_is_opendrive",
        )
    for include in root.iter("include"):
        if next(include.iterancestors("userData"), None) is None:
            raise MapReadError(
                f"{file}: includes {include.get('file', '?')!r:.80} (<include>, line {include.sourceline}), "
                "which is not followed; merge the files"
            )
    return root


def read_bytes(file: Path) -> bytes:
    """Return the content of a file.

    Raises:
        MapReadError: it does not exist, cannot be opened, is empty or too large.
    """
    try:
        if file.exists() and not file.is_file():
            raise MapReadError(f"{file}: cannot be opened (not a file); give the path of an .xodr file")
        if file.is_file() and file.stat().st_size > MAX_FILE_BYTES:
            raise MapReadError(f"{file}: larger than {MAX_FILE_BYTES >> 20} MiB; cut the map into parts")
        data = file.read_bytes()
    except (OSError, ValueError) as error:
        if isinstance(error, MapReadError):
            raise
        reason = getattr(error, "strerror", None) or error
        raise MapReadError(f"{file}: cannot be opened ({reason}); give the path of an .xodr file") from error
    if not data or data.isspace():
        raise MapReadError(f"{file}: the file is empty; give an OpenDRIVE file")
    # No tag is shorter than this.
    if len(data) > MAX_TAGS * len(b"<a>") and data.count(b"<") > MAX_TAGS:
        raise MapReadError(f"{file}: more than {MAX_TAGS} tags; cut the map into parts")
    return data
