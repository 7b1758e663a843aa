"""The four tables of the reference study's database, on any server that SQLAlchemy speaks to.

Conventions of the tables: radial speed **negative away**, range in decametres, times in seconds since
1904-01-01 (LabVIEW), `system.dt` at the end of an accumulation, `control` with start and stop of each ray.
"""

from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Any

from geometry.errors import InputError, UnavailableError

if TYPE_CHECKING:
    import sqlalchemy as sa

METRES_IN_DECAMETRE = 10.0

#: Rows that are fetched or sent at once.
CHUNK_ROWS = 50_000

#: Columns of the tables; `!` marks those that a reader cannot do without.
COLUMNS = {
    "scenario": ("!scn_id", "scn_type", "dt_start", "dt_stop", "gw_start_id", "gw_stop_id", "pulse", "fft"),
    "system": ("!scn_id", "!dt", "lati", "longi", "alti", "head", "pitch", "roll", "temp", "humid"),
    "control": ("!scn_id", "!gw_id", "!dt_start", "!dt_stop", "!azim", "!elev", "nbRG", "acc"),
    "measurement": ("!gw_id", "!dist", "!radSpeed", "cnr", "disp"),
}

#: Tables without which there is no ray.
NEEDED_TABLES = ("control", "measurement")

_INTEGERS = ("scn_id", "gw_start_id", "gw_stop_id", "gw_id", "fft", "nbRG")


def database_url(place: str | Path) -> str:
    """SQLAlchemy's URL of a database: one that is given as such, or of an SQLite file.

    Examples
    --------
    >>> database_url("mysql+pymysql://user:word@host/db"), database_url(Path("study.sqlite"))
    ('mysql+pymysql://user:word@host/db', 'sqlite:///study.sqlite')
    """
    text = str(place)
    return text if "://" in text else f"sqlite:///{text}"


@contextmanager
def connected(place: str | Path, *, write: bool = False) -> "Iterator[sa.Connection]":
    """A connection in one transaction: what is written is there as a whole or not at all.

    Raises
    ------
    UnavailableError
        If the extra `db` is not installed.
    InputError
        If there is no such database, or it refuses.
    """
    try:
        import sqlalchemy as sa
    except ImportError as error:
        raise UnavailableError(
            "databases need the extra 'db' (SQLAlchemy, PyMySQL): pip install '.[db]'"
        ) from error
    url = sa.make_url(database_url(place))
    shown = url.render_as_string(hide_password=True)
    if url.drivername.startswith("sqlite") and not write and not Path(url.database or "").is_file():
        raise InputError(f"{shown}: there is no such database file")
    try:
        engine = sa.create_engine(url)
    except ModuleNotFoundError as error:
        raise UnavailableError(f"{shown} needs the driver {error.name!r}: pip install '.[db]'") from error
    try:
        with engine.begin() as connection:
            yield connection
    except sa.exc.DBAPIError as error:
        raise InputError(f"{shown}: the database refuses ({error.orig})") from error
    finally:
        engine.dispose()


def held_columns(connection: "sa.Connection") -> dict[str, dict[str, str]]:
    """The tables that are there: table: our column: the database's column.

    Raises
    ------
    InputError
        If a table or column is missing without which there is no ray.
    """
    import sqlalchemy as sa

    inspector = sa.inspect(connection)
    names = {name.lower(): name for name in inspector.get_table_names()}
    held = {}
    for table, wanted in COLUMNS.items():
        if table not in names:
            if table in NEEDED_TABLES:
                raise InputError(f"the database has no table {table!r}; it has {', '.join(names) or 'none'}")
            continue
        own = {column["name"].lower(): column["name"] for column in inspector.get_columns(names[table])}
        missing = [name[1:] for name in wanted if name.startswith("!") and name[1:].lower() not in own]
        if missing and table in NEEDED_TABLES:
            raise InputError(
                f"table {table!r} has no column {', '.join(missing)}; it has {', '.join(own.values())}"
            )
        if not missing:
            plain = [name.lstrip("!") for name in wanted]
            held[table] = {name: own[name.lower()] for name in plain if name.lower() in own}
    return held


def select(table: str, columns: dict[str, str]) -> "tuple[sa.TableClause, sa.Select[tuple[object, ...]]]":
    """The table and a query of its columns under our names."""
    import sqlalchemy as sa
    from sqlalchemy.sql import quoted_name

    clause = sa.table(quoted_name(table, quote=True), *(sa.column(name) for name in columns.values()))
    return clause, sa.select(*(clause.c[name].label(own) for own, name in columns.items()))


def create_tables(connection: "sa.Connection") -> "sa.MetaData":
    """Make the tables that are not there yet."""
    import sqlalchemy as sa

    metadata = sa.MetaData()
    for table, names in COLUMNS.items():
        columns = [
            sa.Column(name.lstrip("!"), _type(name.lstrip("!")), index=name == "!gw_id") for name in names
        ]
        sa.Table(table, metadata, *columns, quote=True)
    metadata.create_all(connection)
    return metadata


def _type(name: str) -> "sa.types.TypeEngine[Any]":
    import sqlalchemy as sa

    if name == "scn_type":
        return sa.String(8)
    return sa.BigInteger() if name in _INTEGERS else sa.Double()


def scenario_numbers(
    connection: "sa.Connection", held: dict[str, dict[str, str]], wanted: int | None
) -> list[int]:
    """Numbers of the scenarios that have rays, or the one that is wanted."""
    import sqlalchemy as sa

    if wanted is not None:
        return [wanted]
    clause, _ = select("control", held["control"])
    column = clause.c[held["control"]["scn_id"]]
    return [
        int(row[0])
        for row in connection.execute(sa.select(column).distinct().order_by(column))
        if row[0] is not None
    ]
