"""Numbers of the scenarios that a database of the reference study's kind holds."""

from pathlib import Path

from reconstruct.formats.aas_tables import connected, create_tables, held_columns, select


def next_scenario(place: str | Path) -> int:
    """First number that no scenario of a database has; the tables are made where they are not there.

    Parameters
    ----------
    place : str or Path
        SQLAlchemy's URL, or an SQLite file.
    """
    import sqlalchemy as sa

    with connected(place, write=True) as connection:
        create_tables(connection)
        held = held_columns(connection)
        clause, _ = select("control", held["control"])
        highest = connection.execute(sa.select(sa.func.max(clause.c[held["control"]["scn_id"]]))).scalar()
    return 1 if highest is None else int(highest) + 1
