"""A text file of numbers becomes columns: delimiter, header and decimal sign are found, then pandas
parses the columns that are wanted.

Every line that does not fit is counted and named; nothing is guessed about what columns mean
(:mod:`vehnav.logs.columns` does that).
"""

from __future__ import annotations

import csv
import re
import warnings
from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any, Final

import numpy as np
import numpy.typing as npt

from vehnav.errors import Finding, FormatError
from vehnav.logs import digits
from vehnav.logs.clock import NO_TIME
from vehnav.logs.log import Array, TimeArray

if TYPE_CHECKING:
    import pandas as pd

SAMPLE_BYTES: Final = 1 << 18
SAMPLE_ROWS: Final = 50
DELIMITERS: Final = ("\t", ";", "|", ",", " ")
COMMENTS: Final = ("#", "%", "//")
FINE_TIME: Final = re.compile(r"(\d{5,9}|[1-8]\d{9})\.(\d{7,9})")
"""Seconds whose digits a float64 does not keep, of a width that stays."""
MAX_BAD_SHARE: Final = 0.5
"""A column with more text than this does not hold the quantity."""


@dataclass(frozen=True)
class Sheet:
    """How a text file of numbers is laid out.

    Attributes
    ----------
    path : str
    names : tuple of str
        One per column, as in the header; "1", "2", ... where there is no header.
    delimiter : str
        One of :data:`DELIMITERS`; " " stands for any white space.
    decimal : str
        "." or ",".
    skip : int
        Lines before the first line of numbers.
    encoding : str
    preamble : tuple of str
        The lines before the header.
    sample : tuple of tuple of str
        The fields of the first lines of numbers.
    spaced, quoted : bool
        Whether spaces follow the delimiters, and whether there are quotation marks.
    long : tuple of int
        Lines of the sample, counted from 0, that have more fields than there are names.
    """

    path: str
    names: tuple[str, ...]
    delimiter: str
    decimal: str
    skip: int
    encoding: str
    preamble: tuple[str, ...]
    sample: tuple[tuple[str, ...], ...]
    spaced: bool = False
    quoted: bool = False
    long: tuple[int, ...] = ()


def sniff(path: str) -> Sheet:
    """The layout of a text file, from its beginning.

    Raises
    ------
    FormatError
        No line with at least two fields, most of them numbers.
    """
    text, encoding, complete = _beginning(path)
    lines = re.split(r"\r\n|\n|\r", text)
    if not complete and len(lines) > 1:
        lines.pop()
    forms = (None if _is_comment(line) else _form(line) for line in lines)
    skip, form = next(((k, form) for k, form in enumerate(forms) if form is not None), (0, None))
    if form is None:
        raise FormatError(
            f"{path}: no line of numbers among the first {len(lines)} lines; "
            "expected a table with one row per sample"
        )
    delimiter, decimal = form
    sample = tuple(tuple(split(line, delimiter)) for line in lines[skip : skip + SAMPLE_ROWS])
    sample = tuple(fields for fields in sample if any(fields))
    width = Counter(len(fields) for fields in sample).most_common(1)[0][0]
    names, preamble = _header(lines[:skip], delimiter, width)
    names += ("",) * (width - len(names))  # rows that end with a delimiter
    rows = lines[skip : skip + SAMPLE_ROWS]
    pairs = Counter(line.count('"') % 2 for line in rows if '"' in line)
    counts = [len(split(line, delimiter)) for line in rows]
    return Sheet(
        path,
        names,
        delimiter,
        decimal,
        skip,
        encoding,
        preamble,
        sample,
        spaced=delimiter != " " and f"{delimiter} " in "\n".join(rows),
        quoted=pairs[0] > pairs[1],
        long=tuple(skip + k for k, count in enumerate(counts) if count > len(names)),
    )


def _beginning(path: str) -> tuple[str, str, bool]:
    """Text of the first bytes, encoding, and whether that is all."""
    with Path(path).open("rb") as file:
        raw = file.read(SAMPLE_BYTES + 1)
    complete = len(raw) <= SAMPLE_BYTES
    raw = raw[:SAMPLE_BYTES]
    if raw[:2] in (b"\xff\xfe", b"\xfe\xff"):
        return raw.decode("utf-16", errors="replace"), "utf-16", complete
    try:
        text = raw.decode("utf-8-sig", errors="strict" if complete else "ignore")
        return text, "utf-8-sig" if raw[:3] == b"\xef\xbb\xbf" else "utf-8", complete
    except UnicodeDecodeError:
        return raw.decode("latin-1"), "latin-1", complete


def _is_comment(line: str) -> bool:
    return not line.strip() or line.lstrip().startswith(COMMENTS)


def split(line: str, delimiter: str) -> list[str]:
    """Fields of a line, stripped, quotes removed."""
    if delimiter == " ":
        return line.split()
    return [field.strip() for field in next(csv.reader([line], delimiter=delimiter))]


def _number_share(fields: Sequence[str], decimal: str) -> float:
    """Share of the fields that are numbers; empty ones do not count."""
    filled = [field for field in fields if field]
    good = sum(is_number(field, decimal) for field in filled)
    return good / len(filled) if filled else 0.0


def is_number(field: str, decimal: str = ".") -> bool:
    """Whether a field is a number with that decimal sign."""
    if decimal == "," and "." in field:
        return False
    try:
        float(field.replace(",", ".", 1) if decimal == "," else field)
    except ValueError:
        return False
    return True


def _form(line: str) -> tuple[str, str] | None:
    """(delimiter, decimal sign) under which most fields are numbers; None where none does it."""
    best, choice = 0.5, None
    for delimiter in DELIMITERS:
        fields = split(line, delimiter)
        for decimal in (".", ","):
            share = _number_share(fields, decimal)
            if len(fields) > 1 and share > best and not (decimal == "," == delimiter):
                best, choice = share, (delimiter, decimal)
    return choice


def _header(
    lines: Sequence[str], delimiter: str, width: int
) -> tuple[tuple[str, ...], tuple[str, ...]]:
    """Names of the columns and the lines before the header."""
    for k in range(len(lines) - 1, -1, -1):
        line = lines[k].strip().lstrip("#%/").strip()
        if not line:
            continue
        fields = split(line, delimiter)
        if abs(len(fields) - width) <= 1 and len(fields) > 1:
            return tuple(fields), tuple(lines[:k])
        break
    return tuple(str(k + 1) for k in range(width)), tuple(lines)


# ---- parsing ---------------------------------------------------------------------------------


def _parse(sheet: Sheet, **how: Any) -> pd.DataFrame:
    """The rows of a sheet by the pandas C parser, columns named 0, 1, ..."""
    import pandas as pd

    form: dict[str, Any] = {"sep": sheet.delimiter, "skipinitialspace": sheet.spaced}
    if sheet.delimiter == " ":
        form = {"sep": r"\s+"}
    if not sheet.quoted:  # a stray quotation mark must not swallow the rest of the file
        form["quoting"] = csv.QUOTE_NONE
    if sheet.encoding != "utf-8":
        form["encoding"] = sheet.encoding
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", pd.errors.DtypeWarning)  # numbers() counts text
        frame: pd.DataFrame = pd.read_csv(
            sheet.path,
            header=None,
            names=list(range(len(sheet.names))),
            # a long first row would make pandas cut all long rows silently
            skiprows=[*range(sheet.skip), *sheet.long] if sheet.long else sheet.skip,
            decimal=sheet.decimal,
            engine="c",
            index_col=False,
            **form,
            **how,
        )
    return frame


class Table:
    """The rows of a sheet, parsed once.

    Attributes
    ----------
    sheet : Sheet
    rows : int
        Rows that fit the layout.
    findings : list of Finding
        Lines and fields that did not; grows while columns are taken out.
    """

    def __init__(self, sheet: Sheet, clocks: Sequence[int] = ()) -> None:
        """Parse the file; of the columns ``clocks`` all digits are kept."""
        self.sheet = sheet
        self.findings: list[Finding] = []
        self._exact: dict[int, tuple[TimeArray, int]] = {}
        # every column is parsed: with usecols pandas cuts long rows silently
        self._frame, found = self._read_fine(clocks) or self._read()
        self._long = sorted([line + 1 for line in sheet.long] + found)
        self.rows = len(self._frame)
        if not self.rows:
            raise FormatError(f"{sheet.path}: a header, but no rows")
        if self._long:
            text = (
                f"{sheet.path}: {len(self._long)} lines with more than {len(sheet.names)} fields "
                f"dropped (the first is line {self._long[0]})"
            )
            self.findings.append(Finding("bad-rows", "error", text))

    def _read_fine(self, clocks: Sequence[int]) -> tuple[pd.DataFrame, list[int]] | None:
        """:meth:`_read` with fine stamps taken as text; None where not every row has them."""
        forms = {k: form for k in clocks if (form := self._fine_form(k))}
        if not forms:
            return None
        # a longer field shows in what is spare
        widths = {k: f"S{whole + 1 + part + 1}" for k, (whole, part) in forms.items()}
        frame, found = self._read(dtype=widths)
        for k, (whole, part) in forms.items():
            exact = digits.fixed_point(np.asarray(frame[k].to_numpy(), widths[k]), whole, part)
            if exact is None:
                self._exact.clear()
                return None
            self._exact[k] = exact, part
            seconds, rest = np.divmod(exact, 10**part)
            frame[k] = seconds + rest / 10.0**part
        return frame, found

    def _fine_form(self, column: int) -> tuple[int, int] | None:
        """Digits before and behind the point of all fields of the sample; None if not alike."""
        if self.sheet.decimal != ".":
            return None
        fields = [row[column] if len(row) > column else "" for row in self.sheet.sample]
        found = [FINE_TIME.fullmatch(field) for field in fields]
        forms = {(len(one[1]), len(one[2])) if one else None for one in found}
        return forms.pop() if len(forms) == 1 else None

    def _read(self, **how: Any) -> tuple[pd.DataFrame, list[int]]:
        """The frame, and the numbers of the lines that have too many fields."""
        import pandas as pd

        try:
            return _parse(self.sheet, **how), []
        except (UnicodeDecodeError, pd.errors.ParserError):
            pass  # rare; to ask for more from the start costs a quarter of the time
        with warnings.catch_warnings(record=True) as caught:
            warnings.simplefilter("always")
            try:
                frame = _parse(self.sheet, on_bad_lines="warn", encoding_errors="replace", **how)
            except pd.errors.ParserError as error:
                raise FormatError(f"{self.sheet.path}: not a table: {error}") from error
        messages = "".join(str(warning.message) for warning in caught)
        return frame, [int(number) for number in re.findall(r"Skipping line (\d+)", messages)]

    def numbers(self, column: int) -> Array:
        """(rows,) float64: the column; text in it becomes NaN, counted with its first row."""
        import pandas as pd

        series = self._frame[column]
        if pd.api.types.is_numeric_dtype(series.dtype):
            return np.asarray(series.to_numpy(), np.float64)
        values = pd.to_numeric(series, errors="coerce")
        bad = np.flatnonzero(values.isna().to_numpy() & series.notna().to_numpy())
        name = self.sheet.names[column]
        if bad.size > MAX_BAD_SHARE * self.rows:
            raise FormatError(
                f"{self.sheet.path}: column {name!r} does not hold numbers "
                f"(row {bad[0] + 1}: {str(series.iloc[bad[0]])[:40]!r})"
            )
        self._note_text(column, bad, series)
        return values.to_numpy(np.float64)

    def integers(self, column: int) -> TimeArray | None:
        """(rows,) int64 without loss, :data:`NO_TIME` for empty fields; None if not integers."""
        series = self._frame[column]
        if series.dtype == np.int64:
            return series.to_numpy()
        if series.dtype == np.float64 and not series.isna().any():
            return None
        # an empty or broken field kept pandas from reading integers; a float64 has 53 bits only
        read = series if series.dtype != np.float64 else self._again(column, dtype=str)
        if read is None:
            return None
        filled = read.notna().to_numpy()
        text = read.astype(str).str.strip()
        whole = text.str.fullmatch(r"[+-]?(\d{1,18}|[1-8]\d{18})").fillna(False)
        good = whole.to_numpy(dtype=bool) & filled
        if good.sum() < (1.0 - MAX_BAD_SHARE) * filled.sum():
            return None
        self._note_text(column, np.flatnonzero(~good & filled), read)
        values = np.full(self.rows, NO_TIME, np.int64)
        values[good] = text[good].astype("int64").to_numpy()
        return values

    def _again(self, column: int, **how: Any) -> pd.Series[Any] | None:
        """A column parsed in another way; None where that does not work."""
        usecols = None if self._long else [column]
        try:
            series = self._read(usecols=usecols, **how)[0][column]
        except (ValueError, TypeError, OverflowError):
            return None
        return series if len(series) == self.rows else None

    def _note_text(self, column: int, bad: npt.NDArray[np.intp], series: pd.Series[Any]) -> None:
        """A finding for fields that are not numbers."""
        if not bad.size:
            return
        text = (
            f"{self.sheet.path}: {bad.size} fields of column {self.sheet.names[column]!r} are not "
            f"numbers (row {bad[0] + 1}: {str(series.iloc[bad[0]])[:40]!r})"
        )
        self.findings.append(Finding("bad-rows", "error", text))

    def fixed_point(self, column: int, decimals: int) -> TimeArray | None:
        """(rows,) int64: a decimal column times 10**decimals, exact where float64 is not.

        None unless every field has just that many decimals.
        """
        if self.sheet.decimal != ".":
            return None
        if column in self._exact and self._exact[column][1] == decimals:
            return self._exact[column][0]
        exact = self._again(column, dtype={column: np.int64}, thousands=".")
        if exact is None:
            return None
        values = np.asarray(exact.to_numpy(), np.int64)
        rough = self.numbers(column) * 10.0**decimals
        near = np.max(np.abs(values - rough)) <= 1e-12 * np.max(np.abs(rough)) + 1.0
        return values if near else None

    def text(self, column: int) -> pd.Series[Any]:
        """The column as it stands."""
        return self._frame[column]
