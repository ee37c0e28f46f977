"""JSON and protobuf: one object per message -> the same arrays as from CDR."""

from __future__ import annotations

import json
import math
from collections.abc import Callable
from functools import reduce
from typing import TYPE_CHECKING, Any

import numpy as np

from vehnav.errors import FormatError
from vehnav.logs.messages.payload import Batch, Declaration, Decoded, Wanted
from vehnav.logs.messages.types import MAX_DEPTH, MAX_NODES, Array, Path, Scalar, Struct, Text, Type

if TYPE_CHECKING:
    from google.protobuf.descriptor import Descriptor, FieldDescriptor
    from google.protobuf.message import Message

COVARIANCE_SIZE = 9
MISSING = {
    **dict.fromkeys(("height", "v_enu", "v_ned", "v_track"), float("nan")),
    **dict.fromkeys(("covariance", "covariance_type", "accuracy", "status", "stamp", "nanos"), 0),
}
"""What stands for quantities that a message may lack; without any other it is bad."""
MAX_COUNT = 1 << 62
"""Counts beyond it are no time and would not fit."""


class BadMessageError(Exception):
    """A payload that does not say what its schema promises."""


class ObjectDecoder:
    """Parses each payload and takes the wanted leaves out of the object.

    Parameters
    ----------
    parse : callable
        Payload -> object; raises BadMessageError.
    step : callable
        (object, field name) -> field; raises BadMessageError.
    """

    def __init__(
        self,
        wanted: Wanted,
        parse: Callable[[bytes], Any],
        step: Callable[[Any, str], Any],
    ) -> None:
        self.texts: dict[str, str] = {}
        self.problem = ""
        self._parse = parse
        self._step = step
        self._frame = [path for path, (name, _) in wanted.items() if name == "frame"]
        self._leaves: dict[str, list[Path]] = {}
        for path, (name, _) in sorted(wanted.items(), key=lambda item: item[1]):
            if name != "frame":
                self._leaves.setdefault(name, []).append(path)
        self._integers: dict[str, bool] = {}

    def decode(self, batch: Batch) -> Decoded:
        """Wanted leaves of a batch."""
        good: list[int] = []
        rows: dict[str, list[list[float]]] = {name: [] for name in self._leaves}
        view = batch.data.data
        for k, (start, size) in enumerate(
            zip(batch.start.tolist(), batch.size.tolist(), strict=True)
        ):
            try:
                one = self._values(bytes(view[start : start + size]))
            except BadMessageError as error:
                self.problem = str(error)
                continue
            good.append(k)
            for name, values in one.items():
                rows[name].append(values)
        columns = {name: self._column(name, values) for name, values in rows.items() if good}
        return Decoded(np.array(good, np.int64), columns)

    def _values(self, payload: bytes) -> dict[str, list[float]]:
        message = self._parse(payload)
        one = {}
        for name, paths in self._leaves.items():
            try:
                values = [x for path in paths for x in _numbers(self._at(message, path), path)]
            except BadMessageError:
                if name.rstrip("0123456789") not in MISSING:
                    raise
                values = [MISSING[name.rstrip("0123456789")]] * len(paths)
            one[name] = self._checked(name, values)
        if self._frame and "frame" not in self.texts:
            self.texts["frame"] = self._text(message, self._frame[0])
        return one

    def _text(self, message: Any, path: Path) -> str:
        try:
            return str(self._at(message, path))[:256]
        except BadMessageError:
            return ""

    def _at(self, message: Any, path: Path) -> Any:
        return reduce(self._step, path, message)

    def _checked(self, name: str, values: list[float]) -> list[float]:
        """Numbers of one quantity, as many and of the kind that its column holds."""
        if name == "covariance":
            return values if len(values) == COVARIANCE_SIZE else [0.0] * COVARIANCE_SIZE
        if name.startswith(("stamp", "nanos")):
            integers = self._integers.setdefault(name, isinstance(values[0], int))
            if not abs(values[0]) < MAX_COUNT:  # also not a number
                raise BadMessageError("its stamp is not a time")
            return [int(values[0]) if integers else float(values[0])]
        expected = len(self._leaves[name])
        if len(values) != (3 if name in ("gyro", "accel") else expected):
            raise BadMessageError(f"{len(values)} numbers for {name}")
        return values

    def _column(self, name: str, values: list[list[float]]) -> Any:
        kind = np.int64 if self._integers.get(name) else np.float64
        return np.array(values, kind)


def _numbers(value: Any, path: Path) -> list[float]:
    """A number, or a short list of numbers."""
    written = _written(value)
    if written is not None:
        values = [written]
    elif isinstance(value, int | float):
        values = [value]
    elif isinstance(value, str | bytes | dict) or not hasattr(value, "__len__"):
        raise BadMessageError(f"its field {'.'.join(path)} is no number")
    else:
        values = list(value[: COVARIANCE_SIZE + 1])
    for number in values:
        if isinstance(number, bool) or not isinstance(number, int | float):
            raise BadMessageError(f"its field {'.'.join(path)} is no number")
        if isinstance(number, int) and abs(number) >= MAX_COUNT:
            raise BadMessageError(f"its field {'.'.join(path)} is too large")
    return values


def _written(value: Any) -> float | None:
    """The number that a text is; some drivers write the altitude so. None for anything else."""
    if not isinstance(value, str) or len(value) > 40 or "_" in value:
        return None
    try:
        number = float(value)
    except ValueError:
        return None
    return number if math.isfinite(number) else None


# --- JSON ----------------------------------------------------------------------------------------


def json_decoder(_: Declaration, __: Struct, wanted: Wanted) -> ObjectDecoder:
    """Decoder of JSON payloads."""
    return ObjectDecoder(wanted, _parse_json, _json_field)


def _parse_json(payload: bytes) -> Any:
    try:
        return json.loads(payload)
    except (ValueError, RecursionError) as error:
        raise BadMessageError(f"it is no JSON ({str(error)[:80]})") from error


def _json_field(value: Any, name: str) -> Any:
    if not isinstance(value, dict) or name not in value:
        raise BadMessageError(f"it has no field {name!r}")
    return value[name]


def json_tree(declared: Declaration) -> Struct:
    """Tree of a JSON schema; without properties: an empty one, to be learnt from a message.

    Raises
    ------
    FormatError
        No JSON schema.
    """
    if declared.schema_encoding != "jsonschema" or not declared.schema.strip():
        return Struct(declared.type_name)
    try:
        schema = json.loads(declared.schema)
    except (ValueError, RecursionError) as error:
        raise FormatError(f"its JSON schema cannot be read ({str(error)[:80]})") from error
    kind = _JsonSchema(schema).type(schema, declared.type_name, 0)
    return kind if isinstance(kind, Struct) else Struct(declared.type_name)


class _JsonSchema:
    """Reads the parts of a JSON schema (https://json-schema.org) that messages use."""

    def __init__(self, root: Any) -> None:
        self.root = root
        self.left = MAX_NODES

    def type(self, schema: Any, name: str, depth: int) -> Type:
        """The type that a (part of a) schema describes."""
        self.left -= 1
        if not isinstance(schema, dict) or depth > MAX_DEPTH or self.left < 0:
            return Text()
        if isinstance(schema.get("$ref"), str):
            return self.type(self.resolve(schema["$ref"]), name, depth + 1)
        properties = schema.get("properties")
        if isinstance(properties, dict):
            fields = [(k, self.type(inner, k, depth + 1)) for k, inner in properties.items()]
            return Struct(str(schema.get("title", name)), fields)
        kind = schema.get("type")
        if kind in ("number", "integer"):
            return Scalar("f8")
        if kind == "array":
            length = schema.get("minItems")
            fixed = isinstance(length, int) and length == schema.get("maxItems")
            element = self.type(schema.get("items"), name, depth + 1)
            return Array(element, length if fixed else None)
        return Text()

    def resolve(self, reference: str) -> Any:
        """What ``#/a/b`` refers to."""
        part = self.root
        for key in reference.lstrip("#/").split("/"):
            part = part.get(key) if isinstance(part, dict) else None
        return part


def learn_json(name: str, payload: bytes) -> Struct:
    """Tree of a JSON message without a schema, from one message; empty where it is no object."""
    try:
        value = _parse_json(payload)
    except BadMessageError:
        return Struct(name)
    kind = _value_type(value, name, 0)
    return kind if isinstance(kind, Struct) else Struct(name)


def _value_type(value: Any, name: str, depth: int) -> Type:
    if isinstance(value, dict) and depth < MAX_DEPTH:
        return Struct(name, [(k, _value_type(v, k, depth + 1)) for k, v in value.items()])
    if isinstance(value, list) and depth < MAX_DEPTH:
        element = _value_type(value[0], name, depth + 1) if value else Text()
        return Array(element, len(value))
    number = isinstance(value, int | float) and not isinstance(value, bool)
    number = number or _written(value) is not None
    return Scalar("f8") if number else Text()


# --- protobuf ------------------------------------------------------------------------------------


def protobuf_decoder(declared: Declaration, _: Struct, wanted: Wanted) -> ObjectDecoder:
    """Decoder of protobuf payloads."""
    from google.protobuf.message import DecodeError
    from google.protobuf.message_factory import GetMessageClass

    make: type[Message] = GetMessageClass(_descriptor(declared))

    def parse(payload: bytes) -> Message:
        try:
            return make.FromString(payload)
        except (DecodeError, RecursionError) as error:
            raise BadMessageError(f"it is no {declared.type_name}: {str(error)[:80]}") from error

    return ObjectDecoder(wanted, parse, _protobuf_field)


def _protobuf_field(value: Any, name: str) -> Any:
    field = value.DESCRIPTOR.fields_by_name[name]
    if field.message_type is not None and not field.is_repeated and not value.HasField(name):
        raise BadMessageError(f"its field {name!r} is not set")
    return getattr(value, name)


def protobuf_tree(declared: Declaration) -> Struct:
    """Tree of a protobuf type.

    Raises
    ------
    FormatError
        The optional package is missing, or the schema is none.
    """
    return _message_type(_descriptor(declared), {})


def _descriptor(declared: Declaration) -> Descriptor:
    try:
        from google.protobuf import descriptor_pb2, descriptor_pool
        from google.protobuf.message import DecodeError
    except ImportError:
        raise FormatError(
            "protobuf messages need an optional package: pip install 'vehnav[protobuf]'"
        ) from None
    try:
        files = descriptor_pb2.FileDescriptorSet.FromString(declared.schema)
        pool = descriptor_pool.DescriptorPool()
        waiting = list(files.file)
        names = {file.name for file in waiting}
        while waiting:  # dependencies first, in whatever order they come
            ready = [f for f in waiting if not names.intersection(f.dependency)]
            if not ready:
                raise FormatError("its protobuf files depend on each other in a circle")
            for file in ready:
                pool.Add(file)
                names.discard(file.name)
            waiting = [f for f in waiting if f.name in names]
        return pool.FindMessageTypeByName(declared.type_name)
    except (DecodeError, TypeError, KeyError, RecursionError) as error:
        raise FormatError(f"its protobuf schema cannot be read ({str(error)[:80]})") from error


def _message_type(message: Descriptor, done: dict[str, Struct]) -> Struct:
    """Tree of a message type; a type inside itself is the same object again."""
    name = message.full_name
    if name not in done:
        done[name] = Struct(name)
        done[name].fields.extend((field.name, _field_type(field, done)) for field in message.fields)
    return done[name]


def _field_type(field: FieldDescriptor, done: dict[str, Struct]) -> Type:
    codes = {
        **dict.fromkeys((field.CPPTYPE_INT32, field.CPPTYPE_ENUM), "i4"),
        field.CPPTYPE_INT64: "i8",
        field.CPPTYPE_UINT32: "u4",
        field.CPPTYPE_UINT64: "u8",
        field.CPPTYPE_DOUBLE: "f8",
        field.CPPTYPE_FLOAT: "f4",
        field.CPPTYPE_BOOL: "u1",
    }
    kind: Type = Text()
    if field.cpp_type in codes:
        kind = Scalar(codes[field.cpp_type])
    elif field.message_type is not None:
        kind = _message_type(field.message_type, done)
    return Array(kind, None) if field.is_repeated else kind
