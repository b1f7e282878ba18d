"""The page's modules in node, for tests that need no browser."""

import json
import shutil
import subprocess
from pathlib import Path
from typing import Any

import pytest

import glazejax.studio

PAGE = Path(glazejax.studio.__file__).parent / "page"


def run(code: str, given: Any) -> Any:
    """What a function body of JavaScript returns for `given`; `load` imports a module of the page."""
    node = shutil.which("node")
    if node is None:
        pytest.skip("no node here, which runs the page's modules (Debian: apt-get install nodejs)")
    program = f"""
        import {{ readFileSync }} from "node:fs";
        const load = (name) => import({PAGE.as_uri()!r} + `/${{name}}.js`);
        const call = async (given) => {{ {code} }};
        const plain = (_, value) => (ArrayBuffer.isView(value) ? [...value] : value);
        console.log(JSON.stringify(await call(JSON.parse(readFileSync(0, "utf8"))), plain));
    """
    done = subprocess.run(
        [node, "--input-type=module", "-e", program],
        input=json.dumps(given),
        capture_output=True,
        text=True,
        check=False,
    )
    assert done.returncode == 0, done.stderr
    return json.loads(done.stdout)
