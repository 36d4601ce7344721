"""Errors that validators of other programs find in exported files, as messages."""

from __future__ import annotations

import json
import os
import shutil
import subprocess
import zipfile
from pathlib import Path

_KHRONOS = """
require(process.argv[1]).validateBytes(new Uint8Array(require('fs').readFileSync(process.argv[2])))
  .then(report => console.log(JSON.stringify(report.issues)));
"""


def find_glb_errors(path: Path) -> list[str] | None:
    """Errors by Khronos' validator; None without it. RELUME_GLTF_VALIDATOR is the folder of its npm package."""
    validator = os.environ.get("RELUME_GLTF_VALIDATOR")
    if not validator or shutil.which("node") is None:
        return None
    command = ["node", "-e", _KHRONOS, validator, str(path)]
    issues = json.loads(subprocess.run(command, capture_output=True, check=True, text=True, timeout=60).stdout)
    return [str(message) for message in issues["messages"] if message["severity"] == 0]  # it lists all by default


def find_usd_errors(path: Path) -> list[str]:
    """Errors by all validators of USD; usd-core comes without MaterialX, so that it does not know its shaders."""
    from pxr import Usd, UsdValidation

    validators = UsdValidation.ValidationRegistry().GetOrLoadAllValidators()
    findings = UsdValidation.ValidationContext(validators).Validate(Usd.Stage.Open(str(path)))
    messages = [each.GetMessage() for each in findings if each.GetType() == UsdValidation.ValidationErrorType.Error]
    return [message for message in messages if "shaderId 'ND_" not in message]


def find_materialx_errors(path: Path) -> list[str]:
    """Errors of the document of an archive by MaterialX, and the images that it names and that are missing."""
    import MaterialX

    document, definitions = MaterialX.createDocument(), MaterialX.createDocument()
    MaterialX.loadLibraries(MaterialX.getDefaultDataLibraryFolders(), MaterialX.getDefaultDataSearchPath(), definitions)
    with zipfile.ZipFile(path) as archive:
        (name,) = (name for name in archive.namelist() if name.endswith(".mtlx"))
        MaterialX.readFromXmlString(document, archive.read(name).decode())
        files = {node.getInputValue("file") for node in document.getNodes() if node.getCategory() == "image"}
        errors = [f"{file} is missing" for file in sorted(files - set(archive.namelist()))]
    document.setDataLibrary(definitions)
    is_valid, message = document.validate()
    return errors if is_valid else [*errors, message]
