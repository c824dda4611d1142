"""Which of our columns a header probably means, in English, German, French and Spanish.

A header is compared without case, accents, spaces and punctuation, and its unit is taken off first: "Ziel X [cm]" is
the column target_x_cm.
"""

from __future__ import annotations

import re
import unicodedata
from collections.abc import Iterable, Mapping, Sequence

_WORDS: Mapping[str, str] = {
    "participant": """
        participant participants participantid participantno participantnumber participantnr participantcode pid ppt
        subject subjectid subjectno subjectnr subj subjid user userid userno person personid
        teilnehmer teilnehmerin teilnehmernr teilnehmerid teilnehmende teilnehmernummer tn tnnr tnid versuchsperson
        versuchspersonen versuchspersonennummer vp vpn vpnr vpid vpcode proband probandin probandennummer probandnr
        nutzer nutzerin benutzer
        participante participantes sujet sujets nosujet numerosujet utilisateur personne codeparticipant idparticipant
        sujeto sujetos usuario persona idparticipante idsujeto codigoparticipante
        """,
    "condition": """
        condition conditions cond conditionid conditionname system technique interface device treatment method mode
        technology
        bedingung bedingungen kondition versuchsbedingung technik gerat methode verfahren eingabegerat modus
        systeme dispositif appareil methode traitement interfaz
        condicion condiciones sistema tecnica dispositivo metodo tratamiento
        """,
    "trial": """
        trial trialno trialnumber trialnr trialid trialindex trialcount tasktrial
        durchgang durchgangnr durchgangsnummer versuch versuchnr versuchsnummer durchlauf aufgabennummer
        essai essais noessai numeroessai
        ensayo ensayos intento prueba numeroensayo
        """,
    "session": "session sessionid sessionno sessionnr sitzung termin seance sesion",
    "period": "period periode reihenfolge order ordernumber ordre orden periodo",
    "sequence": "sequence sequenz abfolge secuencia",
    "questionnaire": "questionnaire instrument survey fragebogen cuestionario encuesta",
    "scale": "scale subscale item question skala subskala frage echelle escala pregunta itemname",
    "rating": "rating answer score points antwort bewertung punkte reponse note respuesta puntuacion calificacion",
    "measure": "measure variable metric dv dependentvariable messgrosse messgroesse mass variablenname mesure medida",
    "value": "value values wert werte messwert valeur valeurs valor valores",
    "start": """
        start starttime timestart tstart begin begintime onset starttimestamp
        startzeit beginn anfang anfangszeit zeitstart debut heuredebut tempsdebut inicio tiempoinicio comienzo
        """,
    "selection": """
        end endtime timeend tend stop stoptime finish selectiontime selection clicktime endtimestamp
        ende endzeit zeitende auswahlzeit klickzeit fin heurefin tempsfin tiempofin final
        """,
    "target_width": """
        targetwidth width targetsize targetdiameter diameter w zielbreite breite zieldurchmesser durchmesser zielgrosse
        largeur largeurcible diametre anchura ancho anchoobjetivo diametro
        """,
    "practice": """
        practice practise practicetrial ispractice training istraining trainingtrial warmup
        ubung uebung ubungsdurchgang uebungsdurchgang training probe probedurchgang aufwarmen
        entrainement pratique echauffement practica entrenamiento
        """,
    "age": "age ageyears alter edad",
    "sex": "sex gender geschlecht sexe genre sexo genero",
}
_PLACES = {
    "target": "target goal ziel cible but objetivo blanco destino tgt",
    "selected": """
        selected selection select click clicked touch hit endpoint response end auswahl gewahlt gewaehlt treffer klick
        clic selectionne toucher seleccion seleccionado toque
        """,
}
_LENGTHS = {
    "mm": "mm millimeter millimetre",
    "cm": "cm centimeter zentimeter",
    "m": "m meter metre metro",
    "px": "px pixel pixels",
}
_TIMES = {
    "s": "s sec secs second seconds sek sekunden seg segundos secondes",
    "ms": "ms msec millis milliseconds millisekunden",
}
_UNIT_WORDS = {word: unit for units in (_LENGTHS, _TIMES) for unit, words in units.items() for word in words.split()}
_UNIT = re.compile(r"(?:[\s_.\-]*[\(\[]\s*(\w+)\s*[\)\]]|[\s_.\-]+(?:in[\s_]+)?(\w+))\s*$")
LENGTHS: Sequence[str] = tuple(_LENGTHS)
UNITS: Mapping[str, Sequence[str]] = {
    **{f"{place}_{axis}": tuple(_LENGTHS) for place in _PLACES for axis in "xyz"},
    "target_width": tuple(_LENGTHS),
    "start": tuple(_TIMES),
    "selection": tuple(_TIMES),
}
"""The columns that have a unit, and in which units they may be given; the first one is ours."""


def plain(header: str) -> str:
    """A header without case, accents, spaces and punctuation."""
    text = unicodedata.normalize("NFKD", header.replace("ß", "ss").casefold())
    return "".join(mark for mark in text if mark.isalnum())


def _by_word() -> dict[str, str]:
    words = {word: column for column, listed in _WORDS.items() for word in listed.split()}
    for place, listed in _PLACES.items():
        for word in listed.split():
            for axis in "xyz":
                for spelled in (f"{word}{axis}", f"{axis}{word}", f"{word}pos{axis}", f"{word}position{axis}"):
                    words.setdefault(spelled, f"{place}_{axis}")
    return words


_BY_WORD = _by_word()


def split_unit(header: str) -> tuple[str, str | None]:
    """A header without its unit, and the unit as we write it: `Zeit (Sek.)` as `Zeit`, `s`."""
    match = _UNIT.search(header.replace(".)", ")").rstrip("."))
    if match:
        unit = _UNIT_WORDS.get(plain(match.group(1) or match.group(2)))
        if unit is not None and match.start() > 0:
            return header[: match.start()].strip(), unit
    return header, None


def meaning(header: str) -> str | None:
    """Our column that a header probably means, with its unit where it has one; None for a column of the study's own."""
    column = _BY_WORD.get(plain(header))
    unit: str | None = None
    if column is None:
        base, unit = split_unit(header)
        column = _BY_WORD.get(plain(base))
    if column is None or column not in UNITS:
        return column
    return f"{column}_{unit if unit in UNITS[column] else UNITS[column][0]}"


def meanings(headers: Iterable[str], columns: Iterable[str]) -> dict[str, str]:
    """Headers that probably mean one of `columns` and are not called so, each with it; a column is given once."""
    listed, wanted = list(headers), set(columns)
    found: dict[str, str] = {}
    for header in listed:
        column = meaning(header)
        if column in wanted and column not in listed and column not in found.values() and column is not None:
            found[header] = column
    return found


EVERY: Sequence[str] = tuple(
    f"{column}_{unit}" if unit else column
    for column in (*_WORDS, *(f"{place}_{axis}" for place in _PLACES for axis in "xyz"))
    for unit in UNITS.get(column, ("",))
    if column not in ("age", "sex")
)
"""Every column that a header may mean, in each unit that it may have."""
