"""The directive `{gallery}`: pictures that the notebooks of this page's list drew, each a link to
its notebook.

With the time that it ran for.
"""

from typing import Any

from docutils import nodes
from notebook_times import seconds
from sphinx.application import Sphinx
from sphinx.util.docutils import SphinxDirective


class Gallery(nodes.General, nodes.Element):
    """Where the pictures go; they are known only once all pages have been read."""


class GalleryDirective(SphinxDirective):
    """Takes no argument."""

    def run(self) -> list[nodes.Node]:
        """The place."""
        return [Gallery()]


def _fill(app: Sphinx, doctree: nodes.document, name: str) -> None:
    for place in list(doctree.findall(Gallery)):
        took = seconds(app.env)
        made = nodes.container(classes=["gallery"])
        for page in app.env.toctree_includes.get(name, []):
            # The last one shows most: earlier ones lead to it.
            pictures = [
                image
                for image in app.env.get_doctree(page).findall(nodes.image)
                if image.get("alt")
            ]
            if not pictures:
                continue
            picture = pictures[-1].deepcopy()
            for size in ("width", "height", "scale"):
                picture.attributes.pop(size, None)
            link = nodes.reference(
                "", "", internal=True, refuri=app.builder.get_relative_uri(name, page)
            )
            link += picture
            title = nodes.reference(
                "", app.env.titles[page].astext(), internal=True, refuri=link["refuri"]
            )
            long = took.get(page)
            ran = nodes.Text("" if long is None else f" {long:.0f} s")
            made += nodes.container(
                "", link, nodes.paragraph("", "", title, ran), classes=["of-gallery"]
            )
        place.replace_self(made)


def setup(app: Sphinx) -> dict[str, Any]:
    """Called by Sphinx."""
    app.add_node(Gallery)
    app.add_directive("gallery", GalleryDirective)
    app.connect("doctree-resolved", _fill)
    # A new picture in a notebook is a new gallery.
    app.connect("env-updated", lambda app, env: ["notebooks/index"])
    return {"parallel_read_safe": True, "parallel_write_safe": True}
