/* What is believed of a node, in the numbers and words of every part of the page.

   `more` is the expected number of unseen objects, `chance` the probability of at least one. What is sought is a
   class, `ALL`, or one of the things that were asked for. */
const Beliefs = (() => {
  "use strict";
  const ALL = -1;  // instead of a class: all classes
  const NOWHERE = "explore";  // instead of a node: rooms that are not found yet

  const percent = (p) =>
    p > 0 && p < 0.005 ? "< 1 %" : p > 0.995 ? "> 99 %" : Math.round(100 * p) + " %";
  const amount = (x) =>
    Number.isInteger(x) ? String(x) : x < 0.005 ? "< 0.01"
      : x < 0.095 ? x.toFixed(2) : x < 9.95 ? x.toFixed(1) : String(Math.round(x));
  const sum = (numbers) => numbers.reduce((a, b) => a + b, 0);
  const nodeName = (view, node) => node === null ? "in no room" : node === NOWHERE ? "rooms not found yet"
    : node ? view.rooms[node - 1].name : view.title;

  /* Things that were asked for are sought as -2, -3, …; `askedAs` turns their places in the answer into these, and back. */
  const things = (view) => view.answer ? view.answer.things : [];
  const askedAs = (k) => ALL - 1 - k;
  const asked = (view, sought) => sought < ALL ? things(view)[askedAs(sought)] : undefined;
  const first = (view) => things(view).length ? askedAs(0) : ALL;
  const isHere = (view, node) => Boolean(view.answer) && node !== null && view.answer.here === node;
  const has = (view, sought) => sought < ALL ? asked(view, sought) !== undefined : sought < view.classes.length;
  const soughtName = (view, sought) => sought === ALL ? "object" : sought < ALL ? asked(view, sought).thing : view.classes[sought];
  const isSought = (sought, thing) =>
    sought === ALL || (sought < ALL ? (thing.asked || []).includes(askedAs(sought)) : thing.class === sought);
  /* "9.0 m", "2 rooms", "2.5" */
  const cost = (view, x) => {
    const unit = view.answer.cost_unit, number = String(Math.round(10 * x) / 10);
    return unit === "m" ? x.toFixed(1) + " m" : unit === "rooms" ? number + (number === "1" ? " room" : " rooms") : number;
  };

  /* Numbers of a node; `unseen` is how many unseen ones are really there, null where nobody knows. */
  function numbers(view, node, sought) {
    if (sought < ALL) return answered(view, node, asked(view, sought));
    const classes = view.classes.map((_, c) => c).filter((c) => sought === ALL || c === sought);
    const total = (table) => sum(classes.map((c) => table[node][c]));
    const seen = total(view.input);
    return {
      node,
      seen,
      more: Math.max(0, total(view.expected) - seen),
      chance: 1 - classes.reduce((none, c) => none * (1 - view.presence[node][c]), 1),
      unseen: view.truth ? total(view.truth) - seen : null,
    };
  }
  /* The same of a thing that was asked for; its `chance` counts seen ones, too. */
  function answered(view, node, { class: name, anywhere, places }) {
    const here = places.filter((place) => node === 0 || place.room === node), c = view.classes.indexOf(name);
    const [place = { probability: 0, if_there: 0, cost: null }] = here, ids = here.flatMap((one) => one.seen);
    return { node, seen: ids.length, ids, more: sum(here.map((one) => one.expected)),
      chance: node === 0 ? anywhere : place.probability, ifThere: place.if_there, cost: place.cost,
      unseen: view.truth && c >= 0 && Number.isInteger(node) ? view.truth[node][c] - ids.length : null };
  }
  /* What rooms are ranked and shaded by: the chance of a class, or how many more of all. */
  const worth = (of, sought) => sought === ALL ? of.more : of.chance;
  const sayWorth = (of, sought) => sought === ALL ? amount(of.more) + " more" : percent(of.chance);

  /* What the darkest room is worth. */
  const mostWorth = (view, sought) =>
    Math.max(1e-9, ...view.rooms.map((_, i) => worth(numbers(view, i + 1, sought), sought)));

  const rankRooms = (view, sought) => sought < ALL ? asked(view, sought).places.map((place) => numbers(view, place.room, sought))
    : view.rooms.map((_, i) => numbers(view, i + 1, sought))
      .sort((a, b) => worth(b, sought) - worth(a, sought) || a.node - b.node);
  /* Classes of which a node shows none, by the chance that one is there; hardly likely ones are left out. */
  const rankClasses = (view, node, most) =>
    view.classes.map((_, c) => ({ class: c, ...numbers(view, node, c) }))
      .filter((of) => of.seen === 0 && of.chance > 0.005)
      .sort((a, b) => b.chance - a.chance || a.class - b.class).slice(0, most);

  /* "86 %, 0.9 more expected" */
  const sayShort = (of, sought) =>
    (sought === ALL ? "" : percent(of.chance) + ", ") + amount(of.more) + " more expected"
      + (of.seen ? ", " + amount(of.seen) + " seen" : "");
  /* "64 %, if there is one: 95 %, 1 seen: 7, 9.0 m": of a place of what was asked for.
     Of what no model counts, how often people noted one down says little, and stands behind. */
  function sayPlace(view, of, sought) {
    const { by, anywhere } = asked(view, sought), isNoted = by === "likeness", ids = of.ids.slice(0, 3).join(", ") + (of.ids.length > 3 ? ", …" : "");
    return [
      isNoted && !of.seen ? `if there is one: ${percent(of.ifThere)}, noted: ${percent(of.chance)}` : percent(of.chance),
      !isNoted && anywhere < 0.95 && !of.seen && "if there is one: " + percent(of.ifThere),
      of.seen && `${of.seen} seen: ${ids}`,
      isHere(view, of.node) ? "robot here" : typeof of.cost === "number" && cost(view, of.cost),
    ].filter(Boolean).join(", ");
  }
  const leastOf = (view, sought) => (sought < ALL ? "any " : "at least one unseen ") + soughtName(view, sought);
  /* "86 % for at least one unseen sink, 0.9 more expected, 2 seen" */
  function sayLong(view, node, sought) {
    const of = numbers(view, node, sought);
    const chance = sought === ALL ? "" : percent(of.chance) + " for " + leastOf(view, sought) + ", ";
    return chance + sayShort(of, ALL);
  }
  const say = (view, node, sought) =>
    nodeName(view, node) + (isHere(view, node) ? ", where the robot is: " : ": ") + sayLong(view, node, sought);
  return { ALL, NOWHERE, percent, amount, sum, cost, nodeName, things, askedAs, asked, first, has, soughtName, isSought, isHere, numbers,
    worth, mostWorth, rankRooms, rankClasses, sayWorth, sayShort, sayPlace, leastOf, sayLong, say };
})();
