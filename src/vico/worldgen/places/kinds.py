"""What the words of other sources of places mean: our category, and OpenStreetMap's word for the kind.

Words are Google's place types (tables A and B of the new API, and the legacy ones) and Overture's categories of both
taxonomies. Overture has some two thousand: those that differ from their group are listed, the rest follow from their
wider words, their endings, or are offices.
"""

from __future__ import annotations

from collections.abc import Sequence

from vico.world.model import Category


def _table(text: str, category: Category | None) -> dict[str, tuple[Category, str] | None]:
    """Words of a text; ``word:kind`` where OpenStreetMap says it otherwise."""
    table: dict[str, tuple[Category, str] | None] = {}
    for entry in text.split():
        word, _, kind = entry.partition(":")
        table[word] = None if category is None else (category, kind or word)
    return table


_WORDS: dict[str, tuple[Category, str] | None] = {
    **_table(
        """hotel lodging:hotel accommodation:hotel hostel motel resort:hotel resort_hotel:hotel
        extended_stay_hotel:hotel bed_and_breakfast:guest_house guest_house inn:guest_house
        lodge:guest_house private_guest_room:guest_house budget_japanese_inn:guest_house
        japanese_inn:guest_house service_apartments:apartment cottage:chalet holiday_rental_home:apartment
        vacation_rental:apartment farmstay:guest_house cabin:chalet beach_resort:hotel health_retreats:hotel
        mountain_huts:guest_house country_inn:guest_house""",
        Category.ACCOMMODATION,
    ),
    **_table(
        """restaurant food:restaurant eat_and_drink:restaurant food_and_drink:restaurant cafe coffee_shop:cafe
        tea_house:cafe tea_room:cafe cafeteria:canteen food_court bar pub wine_bar:bar cocktail_bar:bar
        sports_bar:bar beer_bar:pub beer_garden:biergarten irish_pub:pub gastropub:pub lounge:bar
        lounge_bar:bar hookah_bar:bar brewery:pub fast_food_restaurant:fast_food meal_takeaway:fast_food
        meal_delivery:fast_food sandwich_shop:fast_food hamburger_restaurant:fast_food
        pizza_restaurant:fast_food bagel_shop:cafe donut_shop:cafe juice_shop:cafe juice_bar:cafe
        smoothie_juice_bar:cafe bubble_tea:cafe acai_shop:cafe cat_cafe:cafe dog_cafe:cafe
        ice_cream_shop:ice_cream ice_cream gelato:ice_cream frozen_yogurt_shop:ice_cream dessert_shop:cafe
        dessert_restaurant:cafe deli:fast_food delicatessen:fast_food diner:restaurant bistro:restaurant
        brasserie:restaurant steakhouse:restaurant steak_house:restaurant buffet_restaurant:restaurant
        bar_and_grill:restaurant bar_and_grill_restaurant:restaurant food_stand:fast_food
        food_truck:fast_food food_truck_stand:fast_food snack_bar:fast_food noodle_shop:fast_food
        taco_stand:fast_food kebab_shop:fast_food internet_cafe soup_kitchen:restaurant""",
        Category.FOOD,
    ),
    **_table(
        """store:shop shop retail:shop shopping:shop supermarket grocery_store:supermarket
        grocery_or_supermarket:supermarket asian_grocery_store:supermarket convenience_store:convenience
        bakery confectionery candy_store:confectionery chocolate_shop:confectionery butcher_shop:butcher
        food_store:deli health_food_store:health_food liquor_store:alcohol clothing_store:clothes
        womens_clothing_store:clothes shoe_store:shoes jewelry_store:jewelry department_store
        shopping_mall:mall shopping_center:mall market:marketplace farmers_market:marketplace
        flea_market:marketplace book_store:books bookstore:books gift_shop:gift florist
        electronics_store:electronics cell_phone_store:mobile_phone mobile_phone_store:mobile_phone
        computer_store:computer furniture_store:furniture home_goods_store:houseware
        home_improvement_store:doityourself hardware_store:hardware building_materials_store:trade
        garden_center:garden_centre pet_store:pet bicycle_store:bicycle bicycle_shop:bicycle
        sporting_goods_store:sports toy_store:toys thrift_store:second_hand discount_store:variety_store
        warehouse_store:wholesale wholesaler:wholesale tobacco_shop:tobacco eyewear_and_optician:optician
        optician cosmetic_and_beauty_supplies:cosmetics drugstore:chemist pharmacy bank atm:bank
        financial_service:bank credit_union:bank post_office currency_exchange:bureau_de_change
        money_transfer_services:money_transfer pawn_shop:pawnbroker gas_station:fuel car_dealer:car
        car_rental car_repair auto_parts_store:car_parts tire_shop:tyres car_wash truck_dealer:car
        automotive:car_repair automotive_repair:car_repair motorcycle_dealer:motorcycle
        electric_vehicle_charging_station:fuel ev_charging_station:fuel hair_care:hairdresser
        hair_salon:hairdresser barber_shop:hairdresser barber:hairdresser beauty_salon:beauty
        beauty_and_spa:beauty nail_salon:beauty makeup_artist:beauty skin_care_clinic:beauty
        tanning_studio:beauty beautician:beauty body_art_service:tattoo tattoo_and_piercing:tattoo
        foot_care:beauty massage:massage massage_therapy:massage laundry dry_cleaning laundromat:laundry
        tailor shoe_repair:shoemaker locksmith photography_store_and_services:photo travel_agency
        travel_agents:travel_agency tour_agency:travel_agency hardware:hardware art_supply_store:art
        musical_instrument_store:musical_instrument printing_services:copyshop rental_service:rental
        funeral_home:funeral_directors catering_service:catering pet_groomer:pet_grooming""",
        Category.STORE,
    ),
    **_table(
        """corporate_office:company business_center:company coworking_space farm:farm ranch:farm manufacturer:company
        accounting:accountant accountant lawyer consultant:consulting insurance_agency:insurance
        real_estate_agency:estate_agent real_estate:estate_agent real_estate_agent:estate_agent
        employment_agency professional_services:company business_to_business:company
        services_and_business:company business:company private_establishments_and_corporates:company
        mass_media:newspaper media_company:newspaper telecommunications_service_provider:telecommunication
        telecommunications:telecommunication lifestyle_services:company home_service:company pets:veterinary
        veterinary_care:veterinary veterinarian:veterinary city_hall:townhall town_hall:townhall
        local_government_office:government government_office:government
        public_service_and_government:government community_and_government:government courthouse embassy
        police police_station:police police_department:police neighborhood_police_station:police
        fire_station fire_department:fire_station health:clinic health_and_medical:clinic health_care:clinic
        doctor:doctors dentist dental_clinic:dentist dental_hygienist:dentist hospital
        medical_lab:laboratory medical_clinic:clinic medical_center:clinic chiropractor:clinic
        physiotherapist:clinic physical_therapy:clinic wellness_center:clinic education:school school
        primary_school:school secondary_school:school middle_school:school elementary_school:school
        high_school:school preschool:kindergarten day_care_preschool:kindergarten
        child_care_agency:childcare college_university:university university college
        library_office:government driving_school language_school music_school research_institute
        social_service_organizations:social_facility non_profit_organization:association
        nonprofit_organization:association community_service:social_facility post_depot
        conference_center:conference_centre courier_service:logistics moving_company:company storage:company
        storage_facility:company electrician plumber painter:painter roofing_contractor:company
        general_contractor:company contractor:company""",
        Category.OFFICE,
    ),
    **_table(
        """museum art_museum:museum history_museum:museum science_museum:museum childrens_museum:museum
        art_gallery:gallery gallery movie_theater:cinema cinema theatre performing_arts_theater:theatre
        theatre_venue:theatre theaters_and_performance_venues:theatre opera_house:theatre
        concert_hall:theatre philharmonic_hall:theatre comedy_club:theatre auditorium:theatre
        music_venue:theatre live_music_venue:theatre performing_arts:theatre performing_arts_venue:theatre
        amphitheatre:theatre amphitheater:theatre night_club:nightclub dance_club:nightclub dance_hall:dance
        casino arcade:amusement_arcade video_arcade:amusement_arcade amusement_center:amusement_arcade
        karaoke:nightclub karaoke_venue:nightclub bowling_alley escape_room:escape_game
        escape_rooms:escape_game library cultural_center:arts_centre arts_and_entertainment:arts_centre
        artist_studio:arts_centre art_studio:arts_centre community_center:community_centre community_centre
        event_venue:events_venue venue_and_event_space:events_venue banquet_hall:events_venue
        wedding_venue:events_venue convention_center:events_venue social_club:social_centre aquarium zoo
        planetarium observatory:planetarium tourist_attraction:attraction
        attractions_and_activities:attraction cultural_and_historic:attraction
        historical_landmark:attraction landmark_and_historical_building:attraction
        historical_place:attraction cultural_landmark:attraction amusement_park:theme_park
        water_park:theme_park gym:fitness_centre fitness_center:fitness_centre yoga_studio:fitness_centre
        pilates_studio:fitness_centre active_life:sports_centre sports_and_recreation:sports_centre
        sports_complex:sports_centre sports_club:sports_centre sports_activity_location:sports_centre
        sports_school:sports_centre athletic_field_house:sports_centre martial_arts_club:dojo
        dance_school:dance swimming_pool:sports_centre ice_skating_rink:ice_rink skating_rink:ice_rink
        stadium:arena stadium_arena:arena arena spa sauna:sauna public_bath public_bathroom_spa:spa
        day_spa:spa spas:spa indoor_playcenter:amusement_arcade virtual_reality_center:amusement_arcade
        church:place_of_worship mosque:place_of_worship synagogue:place_of_worship
        hindu_temple:place_of_worship buddhist_temple:place_of_worship shinto_shrine:place_of_worship
        temple:place_of_worship cathedral:place_of_worship church_cathedral:place_of_worship
        place_of_worship religious_organization:place_of_worship gurdwara:place_of_worship
        monastery:place_of_worship""",
        Category.ENTERTAINMENT,
    ),
    **_table(
        """park city_park:park national_park:park state_park:park public_plaza:square plaza:square town_square:square
        garden botanical_garden:garden playground dog_park picnic_ground:picnic_site
        observation_deck:viewpoint scenic_spot:viewpoint lookout:viewpoint hiking_area:park
        skateboard_park:pitch skate_park:pitch athletic_field:pitch tennis_court:pitch
        basketball_court:pitch soccer_field:pitch baseball_field:pitch beach:beach fountain
        sculpture:fountain statue_sculpture:fountain miniature_golf_course:miniature_golf monument:fountain
        community_garden:garden nature_reserve:park nature_preserve:park""",
        Category.OPEN,
    ),
    **_table(
        """train_station:station subway_station:station light_rail_station:station transit_station:station
        metro_station:station bus_station bus_stop:bus_station transit_depot:bus_station
        transit_stop:bus_station ferry_terminal ferry_service:ferry_terminal tram_stop
        railway_station:station""",
        Category.TRANSIT,
    ),
    # Words for what nobody goes to, or what says nothing.
    **_table(
        """establishment point_of_interest premise subpremise street_address route intersection political locality
        sublocality neighborhood postal_code country plus_code natural_feature geocode room floor landmark
        administrative_area_level_1 administrative_area_level_2 colloquial_area archipelago continent
        parking parking_lot parking_garage rest_stop airport international_airport airstrip heliport
        taxi_stand taxi_service taxi_rank cemetery campground camping_cabin rv_park mobile_home_park
        apartment_building apartment_complex condominium_complex housing_complex apartments condominium
        housing bridge mountain mountain_peak river lake island forest structure_and_geography
        geographic_entities public_toilet public_bathroom restroom public_restroom street_art bicycle_path
        hiking_trail electric_utility_provider water_tower marina golf_course off_roading_area cycling_park
        travel travel_and_transportation transportation""",
        None,
    ),
}  # fmt: skip

_ENDINGS: tuple[tuple[tuple[str, ...], tuple[Category, str]], ...] = (
    (("_restaurant", "restaurants", "_diner", "_eatery", "_grill", "_food"), (Category.FOOD, "restaurant")),
    (("_cafe", "_coffee", "_tea_room", "coffee_roastery"), (Category.FOOD, "cafe")),
    (("_bar", "_pub", "_brewery", "_winery", "_taproom", "_distillery"), (Category.FOOD, "bar")),
    (("_hotel", "_motel", "_hostel", "_resort", "_inn"), (Category.ACCOMMODATION, "hotel")),
    (("_clothing", "_clothing_store", "_boutique", "_apparel"), (Category.STORE, "clothes")),
    (("_store", "_shop", "_market", "_dealer", "_supermarket", "_supplies", "_retail", "_outlet", "_boutiques"),
     (Category.STORE, "shop")),
    (("_salon", "_barber", "_waxing"), (Category.STORE, "beauty")),
    (("_bank", "_atm", "_banks"), (Category.STORE, "bank")),
    (("_museum",), (Category.ENTERTAINMENT, "museum")),
    (("_theater", "_theatre", "_venue", "_hall", "_club"), (Category.ENTERTAINMENT, "events_venue")),
    (("_gym", "_fitness", "_arena", "_stadium", "_rink", "_center_sports"), (Category.ENTERTAINMENT, "sports_centre")),
    (("_church", "_mosque", "_temple", "_synagogue", "_shrine", "_cathedral"),
     (Category.ENTERTAINMENT, "place_of_worship")),
    (("_park", "_garden", "_plaza", "_square"), (Category.OPEN, "park")),
    (("_field", "_court", "_pitch"), (Category.OPEN, "pitch")),
    (("_school", "_kindergarten", "_academy"), (Category.OFFICE, "school")),
    (("_clinic", "_doctor", "_hospital", "_therapy", "_therapist", "ologist", "_medicine", "_surgeon"),
     (Category.OFFICE, "clinic")),
)  # fmt: skip


def meaning_of(source: str, kind: str, wider: Sequence[str] = ()) -> tuple[Category, str] | None:
    """Our category and kind of a place that a source calls so; None for what nobody goes to.

    Parameters
    ----------
    source
        ``overture`` or ``google``.
    kind, wider
        Its own word, and wider ones, the nearest first.
    """
    if kind in _WORDS:
        meaning = _WORDS[kind]
        # Google's "point_of_interest" says nothing, but a second word may.
        if meaning is not None or source != "google":
            return meaning
    for endings, ending_means in _ENDINGS:
        if kind.endswith(endings):
            return ending_means
    for word in wider:
        known = _WORDS.get(word)
        if known is not None:
            return known
    return (Category.OFFICE, "company") if source == "overture" and kind not in _WORDS else None
