"""Values of another type than that of their schema: USD composes them, but they cannot be read."""

from __future__ import annotations

from functools import lru_cache
from typing import Any, NamedTuple

import numpy as np

from relume.core.import_warnings import ImporterWarning, quote, unsupported

_MAX_WARNINGS = 20  # of one layer
_METADATA = {"metersPerUnit": (int, float), "upAxis": (str,)}


class _ValueType(NamedTuple):
    """Type of a value without its role and precision. shape: of one element."""

    is_array: bool
    shape: tuple[int, ...]
    kind: str


def remove_mistyped(layer: Any, warnings: list[ImporterWarning]) -> None:
    """Remove the attributes of a layer that have another type than in every schema with an attribute of that name.

    Likewise the unit and the up axis of the stage.

    Inputs of shaders have any type. Precisions may differ, and numbers may be integers.

    Args:
        layer: an SdfLayer. warnings: gets a sentence for each of the first attributes.
    """
    from pxr import Sdf

    schema_types, mistyped = _schema_types(), list[Any]()

    def find(path: Any) -> None:
        if not path.IsPrimPropertyPath() or path.name not in schema_types:
            return
        spec = layer.GetObjectAtPath(path)
        if isinstance(spec, Sdf.AttributeSpec) and not _may_be_shader_input(spec):
            value_type = _value_type(spec.typeName)
            as_number = value_type._replace(kind="number") if value_type.kind == "integer" else value_type
            if not {value_type, as_number} & schema_types[path.name]:
                mistyped.append(spec)

    layer.Traverse(Sdf.Path.absoluteRootPath, find)
    for key, types in _METADATA.items():
        if layer.pseudoRoot.HasInfo(key) and not isinstance(layer.pseudoRoot.GetInfo(key), types):
            warnings.append(unsupported(f"Ignored {quote(key)} of the stage: it has the wrong type."))
            layer.pseudoRoot.ClearInfo(key)
    for number, spec in enumerate(mistyped):
        if number < _MAX_WARNINGS:
            message = (
                f"Ignored {quote(spec.name)} of {quote(spec.owner.name)}: it is {spec.typeName}, unlike its schema."
            )
            warnings.append(unsupported(message))
        spec.owner.RemoveProperty(spec)


def _may_be_shader_input(spec: Any) -> bool:
    return bool(spec.name.startswith("inputs:")) and not spec.owner.typeName.endswith("Light")


def _value_type(type_name: Any) -> _ValueType:
    value = type_name.scalarType.defaultValue
    if isinstance(value, (bool, int)):
        return _ValueType(type_name.isArray, (), "integer")
    if isinstance(value, float):
        return _ValueType(type_name.isArray, (), "number")
    if isinstance(value, str):
        return _ValueType(type_name.isArray, (), "text")
    if type(value).__name__.startswith(("Vec", "Matrix")):
        return _ValueType(type_name.isArray, np.shape(value), "number")
    name = type(value).__name__
    return _ValueType(type_name.isArray, (), "quaternion" if name.startswith("Quat") else name)


@lru_cache(maxsize=1)
def _schema_types() -> dict[str, frozenset[_ValueType]]:
    """Types of attributes by name, of all schemas."""
    from pxr import Tf, Usd, UsdGeom, UsdLux, UsdShade, UsdSkel

    registry, types = Usd.SchemaRegistry(), dict[str, set[_ValueType]]()
    assert UsdGeom and UsdLux and UsdShade and UsdSkel  # schemas exist once their module is imported  # noqa: PT018
    for schema in Tf.Type(Usd.SchemaBase).GetAllDerivedTypes():
        name = registry.GetSchemaTypeName(schema)
        definition = registry.FindConcretePrimDefinition(name) or registry.FindAppliedAPIPrimDefinition(name)
        for property_name in definition.GetPropertyNames() if definition else ():
            attribute = definition.GetSchemaAttributeSpec(property_name)
            if attribute:
                types.setdefault(property_name, set()).add(_value_type(attribute.typeName))
    return {name: frozenset(allowed) for name, allowed in types.items()}
