"""Errors that validators of other programs find in exported files."""

from __future__ import annotations

import os
import shutil
import subprocess
import zipfile
from pathlib import Path

import MaterialX
from pxr import Usd, UsdValidation

_KHRONOS = """
require(process.argv[1]).validateBytes(new Uint8Array(require('fs').readFileSync(process.argv[2])))
  .then(report => console.log(report.issues.numErrors));
"""


def count_glb_errors(path: Path) -> int | None:
    """Errors by Khronos' validator; None without it. RELUME_GLTF_VALIDATOR is the folder of its npm package."""
    validator = os.environ.get("RELUME_GLTF_VALIDATOR")
    if not validator or shutil.which("node") is None:
        return None
    command = ["node", "-e", _KHRONOS, validator, str(path)]
    return int(subprocess.run(command, capture_output=True, check=True, text=True, timeout=60).stdout)


def count_usd_errors(path: Path) -> int:
    """Errors by all validators of USD, but for shaders of MaterialX, which usd-core does not know."""
    validators = UsdValidation.ValidationRegistry().GetOrLoadAllValidators()
    findings = UsdValidation.ValidationContext(validators).Validate(Usd.Stage.Open(str(path)))
    errors = (each for each in findings if each.GetType() == UsdValidation.ValidationErrorType.Error)
    return sum("shaderId 'ND_" not in each.GetMessage() for each in errors)


def count_materialx_errors(path: Path) -> int:
    """1 if MaterialX does not validate the document of an archive, or an image that it names is missing."""
    document, definitions = MaterialX.createDocument(), MaterialX.createDocument()
    MaterialX.loadLibraries(MaterialX.getDefaultDataLibraryFolders(), MaterialX.getDefaultDataSearchPath(), definitions)
    with zipfile.ZipFile(path) as archive:
        (name,) = (name for name in archive.namelist() if name.endswith(".mtlx"))
        MaterialX.readFromXmlString(document, archive.read(name).decode())
        files = {node.getInputValue("file") for node in document.getNodes() if node.getCategory() == "image"}
        is_complete = files <= set(archive.namelist())
    document.setDataLibrary(definitions)
    return int(not (is_complete and document.validate()[0]))
