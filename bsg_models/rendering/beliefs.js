/* What is believed of a node, in the numbers and words of every part of the page.

   `more` is the expected number of unseen objects, `chance` the probability of at least one. */
const Beliefs = (() => {
  "use strict";
  const ALL = -1;  // instead of a class: all classes

  const percent = (p) =>
    p > 0 && p < 0.005 ? "< 1 %" : p > 0.995 ? "> 99 %" : Math.round(100 * p) + " %";
  const amount = (x) =>
    Number.isInteger(x) ? String(x) : x < 0.005 ? "< 0.01"
      : x < 0.095 ? x.toFixed(2) : x < 9.95 ? x.toFixed(1) : String(Math.round(x));
  const sum = (numbers) => numbers.reduce((a, b) => a + b, 0);
  const nodeName = (view, node) => node ? view.rooms[node - 1].name : view.title;
  const soughtName = (view, sought) => sought === ALL ? "object" : view.classes[sought];
  const isSought = (sought, c) => sought === ALL || c === sought;

  /* Numbers of a node; `unseen` is how many unseen ones are really there, null where nobody knows. */
  function numbers(view, node, sought) {
    const classes = view.classes.map((_, c) => c).filter((c) => isSought(sought, c));
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
  /* What rooms are ranked and shaded by: the chance of a class, or how many more of all. */
  const worth = (of, sought) => sought === ALL ? of.more : of.chance;
  const sayWorth = (of, sought) => sought === ALL ? amount(of.more) + " more" : percent(of.chance);

  /* What the darkest room is worth. */
  const mostWorth = (view, sought) =>
    Math.max(1e-9, ...view.rooms.map((_, i) => worth(numbers(view, i + 1, sought), sought)));

  const rankRooms = (view, sought) =>
    view.rooms.map((_, i) => numbers(view, i + 1, sought))
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
  /* "86 % for at least one unseen sink, 0.9 more expected, 2 seen" */
  function sayLong(view, node, sought) {
    const of = numbers(view, node, sought);
    const chance = sought === ALL ? "" : percent(of.chance) + " for at least one unseen " + soughtName(view, sought) + ", ";
    return chance + sayShort(of, ALL);
  }
  const say = (view, node, sought) => nodeName(view, node) + ": " + sayLong(view, node, sought);
  return { ALL, percent, amount, sum, nodeName, soughtName, isSought, numbers, worth, mostWorth,
    rankRooms, rankClasses, sayWorth, sayShort, sayLong, say };
})();
