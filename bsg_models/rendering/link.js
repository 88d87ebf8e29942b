/* The part of the address after #: it says which view is open, so that a link opens it again.

   Buildings, rooms, classes and things go by their names. What the page does not know changes nothing. */
const Link = (() => {
  "use strict";
  /* Make names unique: the second "a" is "a (2)". */
  function distinct(names) {
    const times = new Map();
    return names.map((name) => {
      times.set(name, (times.get(name) || 0) + 1);
      return times.get(name) > 1 ? `${name} (${times.get(name)})` : name;
    });
  }
  const roomNames = (view) => distinct(view.rooms.map((room) => room.id));
  const words = (view) => distinct(Beliefs.things(view).map((one) => one.thing));

  /* Return what the address says of the look of a page with these views. */
  function read(views, titles) {
    const said = new URLSearchParams(location.hash.slice(1)), look = {};
    const pick = (key, names) => (said.has(key) ? names.indexOf(said.get(key)) : -1);
    const building = pick("building", titles);
    if (building >= 0) look.view = building;
    const view = views[look.view || 0];
    const room = pick("room", roomNames(view)), sought = pick("class", view.classes), asked = pick("find", words(view));
    if (room >= 0) look.node = room + 1;
    if (sought >= 0) look.sought = sought;
    if (asked >= 0) look.sought = Beliefs.askedAs(asked);
    if (said.get("find") === "") look.sought = Beliefs.ALL;
    const least = said.get("least");
    if (/^[0-9]{1,3}$/.test(least) && Number(least) <= 100) look.threshold = Number(least) / 100;
    if (["plan", "layers"].includes(said.get("drawing"))) look.plan = said.get("drawing") === "plan";
    if (["light", "dark"].includes(said.get("theme"))) look.theme = said.get("theme");
    return look;
  }

  /* Say in the address what is shown; a page in a frame has none. */
  function write(views, titles, look) {
    if (window.parent !== window) return;
    const view = views[look.view], said = new URLSearchParams();
    if (views.length > 1) said.set("building", titles[look.view]);
    if (look.node) said.set("room", roomNames(view)[look.node - 1]);
    if (look.sought >= 0) said.set("class", view.classes[look.sought]);
    else if (view.answer) said.set("find", look.sought === Beliefs.ALL ? "" : words(view)[Beliefs.askedAs(look.sought)]);
    if (look.threshold) said.set("least", Math.round(100 * look.threshold));
    said.set("drawing", look.plan ? "plan" : "layers");
    if (look.theme) said.set("theme", look.theme);
    history.replaceState(null, "", "#" + said);
  }
  return { distinct, read, write };
})();
