"""What a place's floor plan is for, by the OpenStreetMap value that made it a place."""

from __future__ import annotations

from vico.world.model import Category


def _words(text: str, use: str) -> dict[str, str]:
    return dict.fromkeys(text.split(), use)


_BY_KIND = {
    **_words("apartments apartment chalet residential", "flat"),
    **_words("hostel dormitory guest_house", "hostel"),
    **_words("cafe ice_cream coffee tea internet_cafe", "cafe"),
    **_words("bar pub biergarten", "bar"),
    **_words("fast_food food_court canteen", "fast_food"),
    **_words("bakery pastry confectionery chocolate", "bakery"),
    **_words("nightclub stripclub", "club"),
    **_words("casino gambling adult_gaming_centre amusement_arcade bowling_alley billiards escape_game", "games"),
    **_words(
        "clothes shoes fashion boutique fashion_accessories bag tailor fabric leather sports outdoor second_hand "
        "baby_goods",
        "clothes",
    ),
    **_words("supermarket grocery wholesale", "supermarket"),
    **_words("department_store mall", "department_store"),
    **_words(
        "pharmacy chemist cosmetics perfumery nutrition_supplements medical_supply hearing_aids herbalist", "pharmacy"
    ),
    **_words(
        "electronics mobile_phone computer hifi video_games photo camera telecommunication appliance", "electronics"
    ),
    **_words("books stationery newsagent_books music musical_instrument antiques comics", "books"),
    **_words("jewelry watches clockmaker optician gold_buyer", "jewellery"),
    **_words("florist garden_centre", "florist"),
    **_words(
        "furniture interior_decoration bed kitchen lighting houseware carpet curtain bathroom_furnishing doityourself "
        "hardware",
        "furniture_shop",
    ),
    **_words("toys games gift pet party hobby", "toys"),
    **_words("alcohol wine beverages deli cheese butcher seafood tobacco", "wine"),
    **_words("kiosk newsagent convenience ticket lottery bookmaker money_lender", "kiosk"),
    **_words("hairdresser beauty massage tattoo barber cosmetology piercing spa sauna public_bath", "salon"),
    **_words("shoemaker bicycle shoe_repair key_cutter watchmaker electronics_repair locksmith", "repair"),
    **_words("laundry dry_cleaning", "laundry"),
    **_words(
        "bank bureau_de_change post_office money_transfer travel_agency post_depot car_rental estate_agent insurance",
        "bank",
    ),
    **_words(
        "embassy townhall courthouse government public_building social_facility association ngo diplomatic", "bureau"
    ),
    **_words("police fire_station", "police"),
    **_words(
        "clinic doctors dentist veterinary alternative physiotherapist psychotherapist laboratory optometrist", "clinic"
    ),
    "hospital": "hospital",
    **_words("school university college driving_school language_school music_school prep_school", "school"),
    **_words("kindergarten childcare", "kindergarten"),
    "library": "library",
    **_words("museum gallery attraction arts_centre castle monument exhibition_centre aquarium planetarium", "museum"),
    "cinema": "cinema",
    **_words("theatre concert_hall opera", "theatre"),
    **_words("place_of_worship church chapel monastery", "church"),
    **_words("events_venue conference_centre community_centre social_centre", "hall"),
    "fitness_centre": "gym",
    **_words("sports_centre dance dojo sports_hall ice_rink arena yoga", "sports"),
    **_words("station halt subway_entrance train_station_entrance bus_station ferry_terminal", "station"),
    **_words(
        "workshop carpenter car_repair car craft fuel car_wash industrial boatbuilder electrician plumber "
        "metal_construction glaziery upholsterer printer",
        "workshop",
    ),
    **_words("parking garage garages carport", "parking"),
    **_words("lawyer architect web_design studio coworking coworking_space company_small", "studio"),
}
_BY_CATEGORY = {
    Category.ACCOMMODATION: "hotel",
    Category.FOOD: "restaurant",
    Category.STORE: "shop",
    Category.OFFICE: "office",
    Category.ENTERTAINMENT: "lounge",
    Category.OPEN: "lounge",
    Category.TRANSIT: "station",
}


def use_of(category: Category, kind: str) -> str:
    """Which use a place's plan is for: one of `uses`, or ``flat`` for a home of any size."""
    return _BY_KIND.get(kind, _BY_CATEGORY[category])
