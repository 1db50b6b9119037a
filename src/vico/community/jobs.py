"""What people do for a living, and in which kinds of places."""

from __future__ import annotations

from dataclasses import dataclass

from vico.community.ground import kind_of
from vico.world.model import Category, Place


@dataclass(frozen=True)
class Job:
    """A trade.

    Attributes
    ----------
    title
        As in "is a ...".
    kinds
        Kinds of places that employ it.
    task
        What one sees them do there: the activity of their working hours, "... at PLACE".
    shift
        Which pattern the hours follow; see `vico.community.work`.
    weight
        How common, besides the number of places.
    ages
        Youngest and oldest.
    pay
        0..1, decides cash in hand.
    root
        How they came to it: completes "PRONOUN ...".
    """

    title: str
    kinds: tuple[str, ...]
    task: str
    shift: str
    weight: float
    ages: tuple[int, int]
    pay: float
    root: str


def _j(
    title: str, kinds: str, task: str, shift: str, weight: float, ages: tuple[int, int], pay: float, root: str
) -> Job:
    return Job(title, tuple(kinds.split()), task, shift, weight, ages, pay, root)


CLOTHES = "clothes boutique shoes bag leather fashion_accessories department_store mall underwear"
COMPANY = "company business_park telecommunication energy_supplier consulting"
HEALTH = "clinic doctors hospital medical_centre healthcare blood_donation"
BANK = "bank financial financial_advisor insurance bureau_de_change money_transfer"
GOV = "government administrative townhall courthouse public_building tax"
NGO = "ngo association foundation charity political_party religion"
HOTEL = "hotel hostel guest_house motel"
CULTURE = "arts_centre theatre music_venue events_venue community_centre studio"

JOBS: tuple[Job, ...] = (
    # food and drink
    _j("barista", "cafe coffee", "Pull espressos and serve the counter", "early", 3.0, (18, 58), 0.25,
       "learned to pour a proper flat white at nineteen and never went back to the desk job"),
    _j("pastry chef", "bakery pastry confectionery cafe", "Bake and fill the display", "early", 1.2, (20, 62), 0.35,
       "trained for three years under a baker who measured everything twice"),
    _j("cook", "restaurant food_court canteen pub", "Work the kitchen line", "kitchen", 1.8, (19, 62), 0.35,
       "started as a dishwasher and worked up one station at a time"),
    _j("waiter", "restaurant bar_and_grill", "Wait tables", "kitchen", 1.8, (18, 60), 0.25,
       "took the job for one summer and found a liking for regulars and full rooms"),
    _j("bartender", "bar pub nightclub biergarten", "Tend the bar", "evening", 1.4, (20, 55), 0.3,
       "knows half the street by their usual order"),
    _j("shift leader", "fast_food food_court ice_cream", "Run the counter and the kitchen", "kitchen", 1.0, (19, 50),
       0.25, "was made shift leader after the shortest apprenticeship the owner can remember"),
    # shops
    _j("bookseller", "books stationery newsagent", "Shelve, recommend and sell books", "shop", 3.0, (20, 67), 0.3,
       "reads the last chapter first and is not sorry"),
    _j("florist", "florist garden_centre", "Tie bouquets and tend the flowers", "shop", 3.0, (20, 66), 0.3,
       "grew up behind a market stall and ties a bouquet in under a minute"),
    _j("pharmacist", "pharmacy chemist", "Fill prescriptions and advise customers", "shop", 2.2, (25, 66), 0.65,
       "likes that a good answer at the counter saves somebody a week of worry"),
    _j("optician", "optician hearing_aids", "Test eyes and fit glasses", "shop", 1.4, (24, 66), 0.55,
       "took over the bench from an aunt who ground lenses by hand"),
    _j("jeweller", "jewelry watches clockmaker", "Serve customers and repair clasps and settings", "shop", 0.9,
       (24, 67), 0.5, "still keeps the first ring that came out crooked"),
    _j("hairdresser", "hairdresser barber", "Cut and colour hair", "shop", 1.8, (19, 64), 0.35,
       "has cut the hair of three generations of the same family"),
    _j("beautician", "beauty cosmetics perfumery massage", "Give treatments and advise customers", "shop", 1.0,
       (20, 60), 0.35, "left office work for something done with the hands"),
    _j("bicycle mechanic", "bicycle bicycle_repair", "True wheels and mend bicycles", "shop", 2.5, (19, 64), 0.35,
       "can tell from the sound which spoke is loose"),
    _j("supermarket cashier", "supermarket convenience grocery greengrocer", "Work the tills and fill the shelves",
       "early", 1.8, (18, 64), 0.25, "came for a student job and stayed for the people"),
    _j("delicatessen keeper", "deli cheese butcher seafood farm wine alcohol health_food", "Slice, weigh and sell",
       "shop", 1.2, (22, 66), 0.35, "insists that everyone taste before they buy"),
    _j("tailor", "tailor fabric sewing curtain", "Measure, cut and sew", "shop", 2.0, (24, 67), 0.4,
       "learned the trade from a grandfather's pattern book"),
    _j("sales assistant", CLOTHES, "Dress the rails and advise customers", "shop", 1.8, (18, 60), 0.25,
       "has an eye for what suits people, and the tact to say it"),
    _j("store manager", CLOTHES + " furniture electronics supermarket sports", "Run the shop floor", "shop", 0.7,
       (30, 63), 0.6, "rose from weekend help to running the floor in eight years"),
    _j("furniture seller", "furniture interior_decoration houseware bed kitchen lighting antiques cookware candles",
       "Show furniture and write up orders", "shop", 0.9, (22, 66), 0.4,
       "would rather talk about joints than about prices"),
    _j("outdoor outfitter", "sports outdoor fishing hunting", "Fit boots and sell gear", "shop", 1.2, (20, 58), 0.3,
       "spends most of the discount on the next trek"),
    _j("record seller", "music musical_instrument photo video games toys anime", "Help customers find what they hum",
       "shop", 1.4, (19, 64), 0.3, "started by swapping duplicates from a private collection"),
    _j("electronics adviser", "mobile_phone electronics computer electronics_repair appliance hifi",
       "Repair phones and advise", "shop", 1.1, (19, 58), 0.35, "takes things apart to relax"),
    _j("gallery assistant", "art gallery frame", "Hang works and talk to visitors", "shop", 1.6, (22, 66), 0.35,
       "paints on Sundays and shows it to nobody"),
    _j("kiosk keeper", "kiosk tobacco newsagent ticket lottery", "Keep the kiosk", "early", 1.2, (20, 68), 0.25,
       "knows who buys the crossword and who only pretends to"),
    _j("travel agent", "travel_agency travel_agent", "Book trips", "office", 0.9, (22, 62), 0.4,
       "has been to forty countries and still packs too much"),
    _j("car dealer", "car motorcycle car_rental car_parts", "Sell and hand over vehicles", "shop", 0.7, (23, 64), 0.55,
       "bought the first moped with paper-round money"),
    _j("shoemaker", "shoemaker shoe_repair locksmith key_cutter", "Mend soles and cut keys", "shop", 1.5, (22, 68),
       0.35, "believes that nothing is worn out before the third repair"),
    _j("laundry attendant", "laundry dry_cleaning", "Press, sort and hand out the washing", "early", 1.2, (20, 65),
       0.25, "likes the warm smell of the place in winter"),
    _j("tattoo artist", "tattoo piercing", "Draw and ink", "shop", 1.0, (22, 52), 0.4,
       "filled school notebooks with dragons"),
    # offices
    _j("software developer", COMPANY + " it web_design", "Write and review code", "office", 2.2, (22, 62), 0.75,
       "taught the family computer to say rude things at eleven"),
    _j("accountant", COMPANY + " accountant tax_advisor", "Close the books and answer questions", "office", 1.5,
       (24, 66), 0.6, "finds comfort in columns that add up"),
    _j("project manager", COMPANY + " it construction_company", "Run meetings and keep the plan", "office", 1.5,
       (28, 64), 0.7, "has a talent for getting quiet people to say what they think"),
    _j("market analyst", COMPANY + " research marketing advertising_agency", "Analyse figures and write reports",
       "office", 1.2, (23, 60), 0.65, "moved from academia for the pace and misses the long summers"),
    _j("UX designer", "web_design it graphic_design design advertising_agency " + COMPANY, "Sketch and test designs",
       "office", 1.1, (22, 56), 0.6, "trained as an illustrator and drifted into interfaces"),
    _j("lawyer", "lawyer notary", "Draft contracts and see clients", "office", 1.4, (28, 68), 0.9,
       "wanted to argue for a living from the age of nine"),
    _j("legal secretary", "lawyer notary courthouse", "Prepare files and keep the calendar", "office", 0.9, (22, 64),
       0.4, "runs the calendar that everyone else depends on"),
    _j("bank adviser", BANK, "Advise customers and check accounts", "bank", 1.6, (24, 64), 0.6,
       "explains mortgages with drawings of ladders"),
    _j("civil servant", GOV, "Prepare files and answer inquiries", "office", 1.5, (25, 67), 0.55,
       "believes that a fair form is half of a fair decision"),
    _j("consular officer", "embassy diplomatic consulate", "Handle papers and appointments", "office", 1.2, (28, 64),
       0.7, "has lived in five capitals and kept a plant alive in each"),
    _j("campaign coordinator", NGO, "Plan campaigns and write to members", "office", 1.6, (23, 62), 0.4,
       "organised a first petition at fifteen, about the school lunch"),
    _j("estate agent", "estate_agent property_management", "Show flats and call clients", "office", 1.1, (23, 64), 0.6,
       "notices the light in a room before anything else"),
    _j("architect", "architect engineer surveyor", "Draw plans and build models", "office", 1.6, (26, 67), 0.7,
       "once spent a winter drawing nothing but staircases"),
    _j("journalist", "newspaper publisher studio radio_station", "Call sources and write", "office", 1.6, (24, 65), 0.5,
       "carries two notebooks in case one fills up"),
    _j("coworking host", "coworking coworking_space conference_centre", "Open the rooms and look after guests",
       "office", 1.4, (22, 50), 0.4, "remembers every guest's name and how they take their coffee"),
    _j("postal worker", "post_office post_depot courier", "Sort and hand out parcels", "early", 1.5, (20, 64), 0.35,
       "used to deliver on foot and still walks everywhere"),
    _j("police officer", "police", "Do the desk and the beat", "office", 1.2, (22, 60), 0.55,
       "thinks that most quarrels end when somebody listens"),
    _j("firefighter", "fire_station ambulance_station", "Drill, check the engines, stand by", "office", 1.0, (20, 56),
       0.55, "holds the station's record on the stairs"),
    # learning and care
    _j("teacher", "school college music_school language_school", "Teach", "school", 2.2, (25, 66), 0.5,
       "still gets letters from a first class of pupils"),
    _j("university lecturer", "university college research_institute", "Teach and do research", "office", 2.4, (29, 68),
       0.65, "wrote a thesis on river names and can still talk about it for hours"),
    _j("driving instructor", "driving_school", "Give lessons", "office", 1.0, (26, 65), 0.4,
       "has not raised a voice in traffic for twelve years"),
    _j("kindergarten teacher", "kindergarten childcare social_facility", "Look after the children", "school", 1.5,
       (21, 62), 0.35, "knows more finger plays than songs"),
    _j("librarian", "library", "Catalogue, advise and run the desk", "day", 2.6, (24, 67), 0.45,
       "once found a lost reader's letter in a returned atlas and delivered it"),
    _j("nurse", HEALTH, "Treat patients", "health", 2.4, (22, 64), 0.5,
       "chose nursing after a long stay in hospital as a child"),
    _j("physician", HEALTH, "See patients", "health", 1.3, (30, 68), 0.95,
       "keeps a drawer of thank-you cards and reads them on bad days"),
    _j("dentist", "dentist", "Treat patients", "health", 1.4, (27, 67), 0.9,
       "hums while drilling, which patients pretend not to mind"),
    _j("dental hygienist", "dentist", "Clean teeth and assist", "health", 0.9, (22, 60), 0.45,
       "can spot a sweet tooth from the waiting room"),
    _j("veterinarian", "veterinary", "Treat animals", "health", 1.3, (27, 66), 0.7,
       "brought home every stray there was"),
    _j("pet shop keeper", "pet pet_grooming", "Feed the animals and advise", "shop", 1.3, (20, 64), 0.3,
       "talks to budgerigars in full sentences"),
    # culture and leisure
    _j("museum guide", "museum gallery attraction castle", "Lead tours and watch the rooms", "day", 2.4, (21, 70), 0.4,
       "can make ten minutes of one painting feel short"),
    _j("curator", "museum arts_centre gallery", "Prepare the next exhibition", "office", 1.0, (29, 67), 0.6,
       "writes wall labels and throws most of them away"),
    _j("projectionist", "cinema", "Prepare the screens and check tickets", "evening", 1.8, (20, 66), 0.3,
       "learned on 35 mm and keeps a splicer for luck"),
    _j("stage technician", "theatre music_venue events_venue", "Rig lights and run the cues", "evening", 1.6, (21, 62),
       0.4, "prefers the view from behind the curtain"),
    _j("event producer", CULTURE + " conference_centre exhibition_centre", "Plan programmes and call artists", "office",
       1.3, (24, 62), 0.5, "booked a first band at sixteen, into a garage"),
    _j("fitness instructor", "fitness_centre sports_centre swimming_pool sports_hall yoga", "Lead classes and coach",
       "sport", 2.0, (20, 56), 0.35, "ran track until an injury turned coaching into the better idea"),
    _j("dance teacher", "dance", "Teach classes", "evening", 1.6, (21, 58), 0.35,
       "counts everything in eights, even the stairs"),
    _j("croupier", "casino gambling", "Deal and watch the tables", "evening", 0.8, (21, 58), 0.45,
       "does card tricks only for children"),
    _j("zoo keeper", "zoo aquarium", "Feed and look after the animals", "day", 1.5, (20, 64), 0.35,
       "was bitten by a parrot once and holds no grudge"),
    _j("parish worker", "place_of_worship monastery", "Visit, organise and keep the house open", "day", 1.1, (25, 68),
       0.4, "keeps the door open an hour longer than the notice says"),
    _j("care worker", "social_facility nursing_home community_centre social_centre", "Look after clients", "health",
       1.4, (20, 64), 0.35, "cared for a grandmother at home and found it could be a profession"),
    # places to stay, open places, transport
    _j("hotel receptionist", HOTEL, "Check guests in and out", "hotel", 2.0, (20, 62), 0.35,
       "speaks four languages, two of them learned at the desk"),
    _j("housekeeper", HOTEL, "Make up the rooms", "hotel", 1.0, (20, 62), 0.25,
       "can read a guest's mood from the state of the pillows"),
    _j("caretaker", "apartments residential dormitory", "Look after the house", "day", 0.8, (30, 67), 0.35,
       "has keys to everything and gossip about nothing"),
    _j("market trader", "marketplace market", "Sell from the stall", "early", 1.5, (22, 70), 0.35,
       "has stood at the same pitch in all weathers"),
    _j("gardener", "garden park cemetery", "Prune, plant and rake", "day", 0.9, (21, 66), 0.35,
       "measures the year by what is in bloom"),
    _j("station attendant", "station train_station bus_station ferry_terminal", "Help passengers", "day", 1.0, (21, 64),
       0.4, "knows the timetable by heart, including the old one"),
)  # fmt: skip

#: Who else works in a category when no job names the kind of the place.
FALLBACK: dict[Category, Job] = {
    Category.STORE: _j("shop assistant", "", "Serve customers and stock the shelves", "shop", 1.0, (18, 66), 0.25,
        "likes the small talk more than the selling"),
    Category.OFFICE: _j("office worker", "", "Do paperwork and answer calls", "office", 1.0, (20, 66), 0.5,
        "is the one who knows where every folder went"),
    Category.ENTERTAINMENT: _j("venue attendant", "", "Look after visitors", "day", 1.0, (18, 66), 0.3,
        "gets to watch everybody's day off"),
    Category.FOOD: _j("kitchen assistant", "", "Prepare and clear", "kitchen", 1.0, (18, 64), 0.25,
        "likes the calm after the lunch rush best"),
}  # fmt: skip

_BY_TITLE = {job.title: job for job in (*JOBS, *FALLBACK.values())}
_KINDS = frozenset(kind for job in JOBS for kind in job.kinds)


def jobs_at(place: Place) -> list[Job]:
    """The trades that a place employs; empty for places where nobody works."""
    kind = kind_of(place)
    if kind in _KINDS:
        return [job for job in JOBS if kind in job.kinds]
    return [FALLBACK[place.category]] if place.category in FALLBACK else []


def job_of(occupation: str) -> Job | None:
    """The trade that an occupation names, e.g. ``barista`` or ``senior barista``; None if it is none we know."""
    words = occupation.lower()
    found = [job for title, job in _BY_TITLE.items() if words == title.lower() or words.endswith(" " + title.lower())]
    return max(found, key=lambda job: len(job.title), default=None)


def works_at(occupation: str, place: Place) -> bool:
    """Whether somebody of this occupation may work at a place; an unknown occupation may work where anybody does."""
    job = job_of(occupation)
    if job is None:
        return place.category not in (Category.TRANSIT,)
    return job in jobs_at(place)


#: Trades that need no place of their own: title, what they do at a desk, at a cafe, how they came to it, pay.
FREELANCE: tuple[tuple[str, str, str, str, float], ...] = (
    ("freelance illustrator", "Draw for a client", "Sketch over coffee", "draws best with noise in the background",
     0.4),
    ("freelance translator", "Translate", "Proofread a translation", "dreams in one language and swears in another",
     0.45),
    ("freelance web developer", "Write code for a client", "Answer clients' mail",
     "quit a big firm to choose the hours", 0.65),
    ("freelance journalist", "Write an article", "Interview somebody over coffee",
     "left the newsroom and kept the deadlines", 0.4),
    ("independent bookkeeper", "Do clients' books", "Meet a client", "rescues small firms from shoeboxes of receipts",
     0.5),
    ("freelance piano tutor", "Prepare lessons and practise", "Plan the week's lessons",
     "keeps an upright piano tuned and the window shut", 0.35),
    ("ghostwriter", "Write a chapter", "Revise pages", "has written four memoirs, none of them under the right name",
     0.5),
    ("photographer", "Edit pictures", "Sort pictures for a client", "is always waiting for the light", 0.45),
    ("podcast producer", "Cut an episode", "Plan the next episode", "built a studio out of a wardrobe and two duvets",
     0.4),
    ("grant writer", "Draft an application", "Meet a client", "turns other people's good ideas into forms", 0.5),
)  # fmt: skip

#: What the retired did before: completes "a retired ...".
RETIRED: tuple[tuple[str, str], ...] = (
    ("tram driver", "drove the same line for thirty-one years and still checks the timetable"),
    ("primary school teacher", "taught half the neighbourhood to read"),
    ("ship's engineer", "spent a working life below deck and now always takes the window seat"),
    ("seamstress", "sewed costumes for a theatre and still mends for the whole house"),
    ("chemist", "ran a laboratory and still labels every jar in the kitchen"),
    ("postmaster", "remembers the street by its names, not its numbers"),
    ("midwife", "brought some two thousand children into the world and is greeted by many of them"),
    ("typesetter", "set type by hand before the machines came and can't abide a bad comma"),
    ("carpenter", "made most of the furniture at home"),
    ("bookkeeper", "keeps the accounts of every club that asks"),
    ("orchestra cellist", "played at the back desk for decades and loved every minute"),
    ("geography teacher", "has a map for every occasion"),
    ("baker", "still bakes for the neighbours, and more than they can eat"),
    ("land surveyor", "can pace out a hundred metres to within a step"),
)

STUDIES = (
    "architecture", "biology", "computer science", "economics", "history", "linguistics", "mathematics", "medicine",
    "music", "philosophy", "social work", "geography", "nursing", "law", "theatre studies",
)  # fmt: skip

#: Why guests are in town: title, purpose, what they do over the day.
GUESTS: tuple[tuple[str, str, str], ...] = (
    ("visiting consultant", "is in town for a month to help a client", "Prepare slides for the client"),
    ("travelling sales representative", "passes through every other week to see customers", "Write up visits"),
    ("visiting researcher", "has come for a term to work in the archives", "Go through notes from the archives"),
    ("touring musician", "has a few free days between two concerts", "Practise quietly"),
    ("travel writer", "is collecting material for a guide to the quarter", "Write up yesterday's notes"),
)
