"""What people care for: values, traits, hobbies, and the groups that grow from them."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class Value:
    """One of Schwartz's ten basic values.

    Attributes
    ----------
    likes
        How the big five lean towards it.
    says
        Each completes "PRONOUN ..." in a biography.
    """

    name: str
    likes: tuple[tuple[str, float], ...]
    says: tuple[str, ...]


VALUES: tuple[Value, ...] = (
    Value("self-direction", (("openness", 1.0),), (
        "would rather choose badly than be told well",
        "has never finished anything by following the instructions",
        "keeps one evening a week free of everybody's plans",
    )),
    Value("stimulation", (("openness", 0.6), ("extraversion", 0.6)), (
        "grows bored when two weeks look alike",
        "takes a different way home whenever there is one",
        "says yes first and looks at the calendar afterwards",
    )),
    Value("hedonism", (("extraversion", 0.7), ("conscientiousness", -0.5)), (
        "holds that a good meal is never a waste of money",
        "does not believe in saving the good cups for guests",
        "can make an occasion out of a Tuesday",
    )),
    Value("achievement", (("conscientiousness", 0.9),), (
        "keeps a list of things to get better at",
        "hates to leave a job half done",
        "counts the stairs and tries to beat the lift",
    )),
    Value("power", (("agreeableness", -0.9), ("extraversion", 0.4)), (
        "likes to be the one who decides",
        "has opinions on how most things should be run",
        "ends up chairing whatever meeting there is",
    )),
    Value("security", (("neuroticism", 0.6), ("openness", -0.4)), (
        "puts a little aside every month, whatever happens",
        "checks the stove twice before leaving the house",
        "knows the way out of every building",
    )),
    Value("conformity", (("agreeableness", 0.4), ("openness", -0.6)), (
        "thinks that rules are there so that nobody has to shout",
        "waits for the green man even at midnight",
        "would never turn up without calling first",
    )),
    Value("tradition", (("openness", -0.7), ("conscientiousness", 0.4)), (
        "keeps the family's holidays exactly as they were",
        "cooks from a handwritten book that is older than the house",
        "still sends postcards from every journey",
    )),
    Value("benevolence", (("agreeableness", 1.0),), (
        "is the first one called when somebody needs help with a move",
        "remembers birthdays without being reminded",
        "always cooks one portion too many, in case",
    )),
    Value("universalism", (("openness", 0.6), ("agreeableness", 0.5)), (
        "signs petitions, and then turns up as well",
        "picks up other people's litter without a word",
        "would give anybody a second chance, and most a third",
    )),
)  # fmt: skip

#: Words for high and for low scores.
TRAITS: dict[str, tuple[tuple[str, ...], tuple[str, ...]]] = {
    "openness": (("curious", "imaginative", "inventive"), ("down-to-earth", "practical", "matter-of-fact")),
    "conscientiousness": (("punctual", "thorough", "dependable"), ("easy-going", "spontaneous", "forgetful")),
    "extraversion": (("talkative", "outgoing", "lively"), ("quiet", "reserved", "private")),
    "agreeableness": (("warm", "patient", "kind"), ("blunt", "stubborn", "sharp-tongued")),
    "neuroticism": (("sensitive", "restless", "easily worried"), ("calm", "even-tempered", "unflappable")),
}


@dataclass(frozen=True)
class Hobby:
    """Something people do for its own sake.

    Attributes
    ----------
    name
        As in "likes NAME".
    at_home
        Activity at home; empty if it can't be done there.
    out, kinds
        Activity elsewhere ("... at PLACE") and the kinds of places for it; empty if it is done at home only.
    traits, values
        Which people tend to have it.
    active
        Keeps them fit.
    """

    name: str
    at_home: str = ""
    out: str = ""
    kinds: tuple[str, ...] = ()
    traits: tuple[str, ...] = ()
    values: tuple[str, ...] = ()
    ages: tuple[int, int] = (16, 90)
    weight: float = 1.0
    active: bool = False


GREEN = ("park", "garden", "nature_reserve", "square", "pedestrian", "plaza", "common", "recreation_ground")
CAFES = ("cafe", "coffee", "bakery", "pastry")
BARS = ("pub", "bar", "biergarten")
GYMS = ("fitness_centre", "sports_centre", "sports_hall", "swimming_pool", "yoga")
ART = ("museum", "gallery", "arts_centre", "art")
BOOKS = ("library", "books")
STAGES = ("theatre", "cinema", "music_venue", "arts_centre", "events_venue", "concert_hall", "opera")

HOBBIES: tuple[Hobby, ...] = (
    Hobby("reading novels", "Read a novel", "Browse the shelves", BOOKS, ("openness",), ("self-direction",),
          weight=1.4),
    Hobby("cooking", "Try out a new recipe", "", (), ("openness",), ("hedonism",), weight=1.2),
    Hobby("running", "", "Run laps and stretch", GREEN, ("conscientiousness",), ("achievement",), (18, 60), 1.1, True),
    Hobby("strength training", "", "Train with weights", GYMS, ("conscientiousness",), ("achievement",), (18, 60), 0.9,
          True),
    Hobby("swimming", "", "Swim lengths", ("sports_centre", "swimming_pool"), (), ("security",), active=True,
          weight=0.8),
    Hobby("yoga", "Do yoga on the living-room floor", "Take a yoga class", GYMS, ("agreeableness",), ("universalism",),
          (20, 75), 0.9, True),
    Hobby("chess", "Play through old chess games", "Play chess", CAFES + GREEN, ("openness",), ("achievement",)),
    Hobby("film", "Watch a film", "See a film", ("cinema",), ("openness",), ("hedonism",)),
    Hobby("the theatre", "", "See a play", ("theatre",), ("openness",), ("tradition",), (25, 90), 0.8),
    Hobby("looking at art", "", "Look at the exhibition", ART, ("openness",), ("universalism",)),
    Hobby("sketching", "Draw from memory", "Sketch passers-by", GREEN + CAFES, ("openness",), ("self-direction",)),
    Hobby("photography", "Sort photographs", "Take photographs", GREEN, ("openness",), ("stimulation",)),
    Hobby("playing the guitar", "Practise the guitar", "", (), ("openness",), ("self-direction",), (16, 70)),
    Hobby("singing", "Practise a choir part", "", (), ("extraversion",), ("tradition",)),
    Hobby("knitting", "Knit a sleeve", "Knit over coffee", CAFES, ("conscientiousness",), ("tradition",), weight=0.8),
    Hobby("board games", "Sort and mend board games", "Play a board game", BARS + CAFES, ("extraversion",),
          ("stimulation",), (18, 65)),
    Hobby("video games", "Play a video game", "", (), (), ("stimulation",), (16, 48)),
    Hobby("languages", "Learn vocabulary", "Practise a language over coffee", CAFES, ("openness",), ("universalism",)),
    Hobby("tending balcony plants", "Water and repot the plants", "", (), ("agreeableness",), ("security",)),
    Hobby("birdwatching", "", "Watch birds", ("park", "garden", "nature_reserve"), ("openness",), ("universalism",),
          (25, 90), 0.7),
    Hobby("baking bread", "Knead and bake a loaf", "", (), ("conscientiousness",), ("tradition",)),
    Hobby("crosswords", "Solve the crossword", "Solve the crossword over coffee", CAFES, (), ("conformity",), (40, 90)),
    Hobby("local history", "Read about the old quarter", "Read in the local history section", BOOKS, ("openness",),
          ("tradition",), (30, 90), 0.8),
    Hobby("football on television", "Watch a match", "Watch the match", BARS, ("extraversion",), ("conformity",),
          (18, 80), 0.8),
    Hobby("craft beer", "", "Taste a new beer", BARS, ("extraversion",), ("hedonism",), (22, 65), 0.7),
    Hobby("dancing", "", "Dance", ("dance", "nightclub", "music_venue"), ("extraversion",), ("hedonism",), (18, 70),
          0.7, True),
    Hobby("flea-market finds", "Restore an old lamp", "Look through second-hand things",
          ("antiques", "second_hand", "marketplace", "charity", "junk"), ("openness",), ("self-direction",), (22, 85),
          0.7),
    Hobby("long walks", "", "Take a walk", GREEN, (), ("universalism", "security"), active=True),
    Hobby("writing letters", "Write a letter to an old friend", "", (), ("agreeableness",), ("benevolence",), (30, 90),
          0.7),
    Hobby("repairing things", "Repair a radio", "", (), ("conscientiousness",), ("self-direction",), (18, 85), 0.8),
)  # fmt: skip


@dataclass(frozen=True)
class Circle:
    """A kind of group.

    Attributes
    ----------
    name
        With ``{place}`` for the name of the meeting place.
    activity
        What they do when they meet: the activity in schedules, "... at PLACE".
    description
        One or two sentences, the first about what they do.
    kinds
        Kinds of places where they can meet.
    times
        Start of the meeting and how long it takes, minutes.
    hobbies, values
        Who is drawn to it.
    statuses
        Ways of life it is for.
    slot
        morning, lunch, afternoon or evening.
    meal
        Whether meeting is a meal.
    """

    name: str
    activity: str
    description: str
    kinds: tuple[str, ...]
    times: tuple[tuple[int, int], ...]
    slot: str
    hobbies: tuple[str, ...] = ()
    values: tuple[str, ...] = ()
    statuses: tuple[str, ...] = ("worker", "freelancer", "student", "retired", "guest")
    ages: tuple[int, int] = (16, 90)
    meal: bool = False


ALL_DAY = ("freelancer", "retired", "student", "guest")


def _t(*times: str, minutes: int) -> tuple[tuple[int, int], ...]:
    return tuple((int(t[:2]) * 60 + int(t[3:]), minutes) for t in times)


CIRCLES: tuple[Circle, ...] = (
    Circle("Book circle", "Talk about the book of the month",
           "Reads one novel a month and argues about the ending. Whoever suggested the book is not allowed to speak "
           "first.", BOOKS + CAFES, _t("17:45", "18:15", minutes=75), "evening",
           ("reading novels", "local history", "languages", "writing letters"), ("self-direction",)),
    Circle("After-work running group", "Run an easy round together",
           "Runs an easy round together and waits for the slowest. Nobody keeps time, officially.", GREEN,
           _t("17:30", "18:00", "18:30", minutes=50), "evening", ("running", "long walks", "strength training", "yoga"),
           ("achievement",), ages=(18, 66)),
    Circle("Chess table", "Play chess",
           "Keeps two boards going and a list of who owes whom a rematch. Beginners are welcome and usually beaten.",
           CAFES + BARS + GREEN, _t("16:30", "17:30", "18:30", minutes=80), "evening",
           ("chess", "board games", "crosswords", "repairing things"), ("achievement",)),
    Circle("Board game crowd", "Play board games",
           "Brings a new game every time and plays an old one in the end. Explaining the rules takes longest.",
           BARS + CAFES, _t("18:30", "19:00", minutes=105), "evening",
           ("board games", "video games", "film", "craft beer"), ("stimulation", "hedonism"), ages=(18, 70)),
    Circle("Film club", "Watch and discuss a film",
           "Sees whatever is on, and then explains why it should have been shorter. Chairs the vote for the year's "
           "worst ending.", ("cinema", "arts_centre", "theatre"), _t("18:00", "18:30", minutes=130), "evening",
           ("film", "the theatre", "photography"), ("hedonism",)),
    Circle("Language table", "Speak each other's languages",
           "Switches the language every half hour. Mistakes are kept in a notebook and read out at the end of the "
           "year.", (*CAFES, *BARS, "library"), _t("17:30", "18:00", minutes=75), "evening",
           ("languages", "reading novels", "singing"), ("universalism", "stimulation")),
    Circle("Supper club", "Have supper together",
           "Tries one kitchen of the quarter after another and splits the bill evenly, whatever was ordered.",
           ("restaurant", "food_court"), _t("18:30", "19:00", minutes=90), "evening",
           ("cooking", "craft beer", "baking bread"), ("hedonism", "benevolence"), meal=True),
    Circle("Neighbourhood council", "Discuss the quarter's affairs",
           "Looks after benches, bins and bicycles, and writes polite letters to the city until something happens.",
           ("community_centre", "library", "cafe", "townhall", "pub", "restaurant"), _t("17:30", "18:00", minutes=60),
           "evening", ("local history", "tending balcony plants"),
           ("universalism", "benevolence", "conformity", "security", "power")),
    Circle("Choir", "Rehearse with the choir",
           "Sings in four parts, three of them sure of themselves. Prepares a concert that is always next spring.",
           ("place_of_worship", "community_centre", "theatre", "arts_centre", "music_school", "school", "events_venue"),
           _t("18:00", "18:30", minutes=90), "evening", ("singing", "playing the guitar", "the theatre"),
           ("tradition",)),
    Circle("Pub quiz team", "Play the quiz",
           "Comes second with great regularity. Lost the title once over the capital of Bhutan and has not forgotten.",
           BARS, _t("18:45", "19:15", minutes=100), "evening",
           ("football on television", "craft beer", "crosswords", "video games"), ("stimulation", "power"),
           ages=(20, 75)),
    Circle("Strength class", "Train together",
           "Counts repetitions aloud, which helps, and complains aloud, which helps more.", GYMS,
           _t("17:15", "18:00", minutes=60), "evening", ("strength training", "yoga", "dancing", "swimming"),
           ("achievement",), ages=(18, 68)),
    Circle("Lunch table", "Have lunch together",
           "Shares one table at noon so that nobody eats over a keyboard. The rule is no shop talk before coffee.",
           ("restaurant", "food_court", "fast_food", "cafe"), _t("11:45", "12:00", "12:15", minutes=40), "lunch",
           ("cooking",), ("benevolence", "hedonism"), meal=True),
    Circle("Morning coffee circle", "Have coffee and go through the news",
           "Meets before noon, reads one newspaper between them and settles the affairs of the world.", CAFES,
           _t("09:30", "10:00", "10:15", minutes=60), "morning",
           ("crosswords", "local history", "writing letters", "knitting"), ("tradition", "security", "benevolence"),
           ALL_DAY),
    Circle("Morning walking group", "Walk and talk",
           "Walks in all weathers and agrees that it was worse last year. Ends on the same bench.", GREEN,
           _t("09:00", "09:30", "10:30", minutes=45), "morning", ("long walks", "birdwatching", "photography", "yoga"),
           ("security", "universalism"), ALL_DAY),
    Circle("Sketching circle", "Sketch together",
           "Draws the same view from four sides and never agrees on the perspective.", ART + GREEN,
           _t("14:00", "14:30", "15:00", minutes=75), "afternoon",
           ("sketching", "looking at art", "photography", "tending balcony plants"), ("self-direction", "universalism"),
           ALL_DAY),
    Circle("Mending and knitting circle", "Knit and mend together",
           "Knits, mends and unpicks. Has clothed every newborn of the quarter since the club began.",
           (*CAFES, "library", "community_centre"), _t("14:00", "15:00", "15:30", minutes=75), "afternoon",
           ("knitting", "flea-market finds", "repairing things", "baking bread"), ("tradition", "benevolence"),
           ALL_DAY),
    Circle("Desk-sharing circle", "Work side by side",
           "Works alone together: four laptops, one table, and a ban on phone calls.",
           (*CAFES, "library", "coworking_space"), _t("10:00", "13:30", "14:00", minutes=90), "afternoon", (),
           ("achievement", "self-direction"), ("freelancer", "student", "guest"), (18, 66)),
    Circle("Late breakfast club", "Have a late breakfast",
           "For those whose day starts when others have been at their desks for an hour. Compares closing times and "
           "sore feet.", (*CAFES, "restaurant", "food_court", "fast_food"), _t("10:30", "11:00", minutes=50), "morning",
           ("cooking", "film", "video games", "dancing"), ("hedonism", "stimulation"), meal=True),
)  # fmt: skip
