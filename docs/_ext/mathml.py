"""Equations as MathML, which browsers draw by themselves: no script, no font and no LaTeX is
needed.
"""

from typing import Any

from docutils import nodes
from docutils.utils.math.latex2mathml import tex2mathml
from sphinx.application import Sphinx
from sphinx.util.math import get_node_equation_number


def _inline(translator: Any, node: nodes.math) -> None:
    translator.body.append(tex2mathml(node.astext()))
    raise nodes.SkipNode


def _block(translator: Any, node: nodes.math_block) -> None:
    translator.body.append(translator.starttag(node, "div", CLASS="equation"))
    # Said again, since a style that lays out the block may take it away.
    formula = tex2mathml(node.astext(), as_block=True)
    translator.body.append(formula.replace("<math ", '<math displaystyle="true" ', 1))
    if node["number"]:
        number = get_node_equation_number(translator, node)
        translator.body.append(f'<span class="number">({number})')
        translator.add_permalink_ref(node, "Link to this equation")
        translator.body.append("</span>")
    translator.body.append("</div>\n")
    raise nodes.SkipNode


def setup(app: Sphinx) -> dict[str, Any]:
    """Called by Sphinx."""
    app.add_html_math_renderer("mathml", (_inline, lambda *_: None), (_block, lambda *_: None))
    app.connect(
        "config-inited", lambda _, config: config.__setattr__("html_math_renderer", "mathml")
    )
    return {"parallel_read_safe": True, "parallel_write_safe": True}
