"""Names for people who don't exist.

First names are common ones from many languages; last names are made up in the sound of several, so that a full name
that belongs to somebody is a coincidence.
"""

from __future__ import annotations

import numpy as np

_FEMALE = """
Aino Alma Amara Anaïs Anneke Asha Astrid Aylin Beatriz Bethan Birgit Camille Carmen Celeste Chiara Chioma Clara
Dalia Daria Edda Elif Elin Elodie Emi Esra Esther Farida Femke Fiona Freya Gemma Greta Hana Hedda Helmi Ilse Imani
Ines Ingrid Irena Isla Ivana Jana Johanna Judit Kaisa Karima Katya Kirsi Laila Lara Leena Leonie Lina Livia Lotte
Lucía Maeve Magda Mai Maren Margit Marisol Marta Meera Mina Mirjam Nadia Naomi Neha Nila Noor Olga Oona Paloma Petra
Pilar Priya Rania Rosa Ruth Saga Salma Sanna Selma Signe Silvia Sofia Solveig Tamar Teresa Thandi Tuuli Ulla Valeria
Vera Wanda Yasmin Yuki Zofia Zuri
"""

_MALE = """
Aaron Abel Adem Albin Alessio Amir Anders Andrei Anton Arjun Arvo Aziz Bastian Benedek Bruno Caspar Cian Cyril Dário
David Demir Diego Dmitri Eero Eino Elias Emil Enzo Erik Ezra Fabian Farid Felix Finn Florian Gabor Giorgos Goran
Gustav Hamza Hannes Harun Henrik Hugo Idris Ilmari Ivo Jakub Janne Jasper Joaquín Joel Jonas Jorge Juhani Kai Karim
Kenji Kofi Kwame Lars Lauri Leandro Levi Lorenz Lucas Luis Magnus Malik Marek Mateus Mikko Milan Mirko Nabil Nikhil
Niko Noah Olavi Omar Oskar Otto Pablo Pascal Pavel Pekka Rafael Rahul Rasmus Remy Ruben Samir Sanjay Sami Stefan
Sven Tariq Tomas Urho Viktor Willem Yusuf
"""

_LAST = """
Aaltovirta Abendrot-Kley Adebisola Ahlqvarn Almqvarra Amarinho Anderholt Arvelunda Asmarov Bachtaler Balintar
Barquenza Bellacorva Bergenvall Birkenau-Holm Bjelkander Boateya Brandovic Brennholt Brukhalter Calderoso Carvenho
Castelmora Chandravel Ciobaran Corviale Dalgaren Darwishan Delacourbe Demirhane Dornfeldt Drakovar Duartelli
Eguchiro Ekholmen Elbaraki Eskelvaara Fairweld Falkenmoor Farahzai Ferrantino Fjordahl Florescano Forsvinge Galvarez
Gandhara-Rao Garrowby Georgallis Gielowska Gondrano Granlunde Grauwinkel Haavistola Hallowmere Hanssonby Haraldvik
Hashimura Heikkaranta Hertzbach Holmgarden Hornvale Ibarrena Igwemba Ikedaro Ilmarvesi Istvandi Jagerstrom
Jankowiecz Jarvenkoski Jokivarsi Jovarnik Kaltenbrook Kamaruzi Kapoorna Karvalainen-Orre Kasimova Keldermaan
Kettunranta Khalidov Kielmark Kinoshima Koivukare Kolarovec Korhela Kowalczar Kristofvik Kuusivaara Lacombray
Lagerhed Lahtivuori Landvergne Larramendia Laukkasalo Leclairvaux Lehtosaari Lindegarde Lomarcini Lundqvara
Machadinho Mahlaba-Ross Makivirta Malmkvist Marchetelli Marlowick Masudani Mbekiwe Melnikar Mendizara Mikkolanpaa
Mirzanov Moralejos Morgensen Mustakivi Nadarajah-Lind Nakagoshi Navratec Niemiluoto Nordvalde Novarescu Nwachuko
Nygaardsen Obradović-Lem Okaforde Olivarra Ormvik Ostergren Ostrovane Palmgrena Papadrakis Parvianen-Lo Pellegrosso
Perkovano Pietravalle Pohjanlehto Prabhakaran-Dey Quintavela Rahimzai Rantakorpi Rasmuden Rautiola Reinholder
Ribalmar Rosendahlen Rossavik Ruusulampi Saarikallas Sabounji Salmenranta Sandoverde Santarosso Sarkovic
Schellenbach Seppovaara Serranova Shirazian-Holt Silverbeck Sinclarey Skogvind Solbakka Sorrentano Steenhuyzer
Stojanar Suvantola Szabolnik Tachibara Takavainio Tamminlehto Tannenwald Tavarinho Tervakoski-Bell Thornbury-Ash
Tikkavesi Tolvanniemi Torvaldsby Uchendara Ullmarsson Valkeameri Vandermolen-Roy Varganyi Vasconcal Veldhuyzen
Vestergard-Moe Viitakoski Volkhanov Wachterle Wennerby Westerlunda Whitcombey Wiklander-Oja Winterhaal Wojtaszar
Yamashiba Yilmazar Zabranski Zamoralde Zettermark Zimmerhof
"""

FEMALE, MALE, LAST = _FEMALE.split(), _MALE.split(), _LAST.split()


class NameBook:
    """Gives names, none twice; first names repeat only when all have been given.

    Parameters
    ----------
    rng
        Decides the order.
    """

    def __init__(self, rng: np.random.Generator) -> None:
        self._first = {
            "female": [FEMALE[k] for k in rng.permutation(len(FEMALE))],
            "male": [MALE[k] for k in rng.permutation(len(MALE))],
        }
        self._last = [LAST[k] for k in rng.permutation(len(LAST))]
        self._given = {"female": 0, "male": 0}
        self._families = 0
        self._used: set[str] = set()
        self._initials: dict[str, int] = {}

    def family(self) -> str:
        """A last name for a new family."""
        name = self._last[self._families % len(self._last)]
        self._families += 1
        return name

    def full(self, gender: str, last: str) -> str:
        """A full name nobody has yet; its initial is one of the least used, so that people are easily told apart."""
        pool, given = self._first[gender], self._given[gender]
        start = given % len(pool)
        if start == 0:
            self._initials.clear()
        best = min(
            (k for k in range(start, len(pool)) if f"{pool[k]} {last}" not in self._used and pool[k][:2] != last[:2]),
            key=lambda k: (self._initials.get(pool[k][0], 0), k),
            default=None,
        )
        if best is None:
            self._given[gender] += len(pool) - start
            return self.full(gender, self.family())
        pool[start], pool[best] = pool[best], pool[start]
        self._given[gender] += 1
        first = pool[start]
        self._initials[first[0]] = self._initials.get(first[0], 0) + 1
        name = f"{first} {last}"
        self._used.add(name)
        return name
