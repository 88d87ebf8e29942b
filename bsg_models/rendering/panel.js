/* The panel beside the picture: ranked rooms, likely classes, every class; and the legend below the picture. */
const Panel = (() => {
  "use strict";
  const { make } = Elements;
  const { ALL, amount, nodeName, percent, soughtName } = Beliefs;
  const FIRST = 10;  // rows of a ranking before it is folded, and steps of a planned way that are listed

  /* Show a node; `go` gets the `{ node }` or `{ sought }` that the user chose. A phone shows the picture after the lead. */
  function show([lead, rest], view, look, go) {
    lead.replaceChildren();
    rest.replaceChildren();
    const { node, sought } = look, asked = node ? undefined : Beliefs.asked(view, sought);
    if (node) button(lead, "back", "← the building", () => go({ node: 0 }));
    make("h2", {}, lead, asked ? "Find " + asked.thing : nodeName(view, node));
    if (!node && view.now) make("p", {}, lead, "As of " + view.now + ".");
    if (asked) answer(lead, view, asked);
    if (node && sought !== ALL) placeOf(lead, view, look);
    if (!node) rankRooms(lead, view, sought, go);
    if (asked) planWay(rest, view);
    if (!node) teach(rest, asked ? "place" : "thing", asked ? asked.habits : view.taught);
    summarize(rest, view, node);
    rankClasses(rest, view, look, go);
    listClasses(rest, view, look);
  }

  function button(parent, name, text, pressed) {
    const made = make("button", { class: name, type: "button" }, parent, text);
    made.addEventListener("click", pressed);
    return made;
  }
  /* Make a paragraph; words in arrays are bold. */
  function paragraph(side, ...words) {
    const line = make("p", {}, side);
    for (const word of words) Array.isArray(word) ? make("b", {}, line, word[0]) : line.append(word);
  }

  function answer(side, view, { by, how, model, anywhere }) {
    const { go_first: first, things, found_within: within } = view.answer, sought = things.length > 1 ? `, to find ${things.map((one) => one.thing).join(", ")}` : "";
    make("p", { class: "go" }, side, first === null ? (typeof within === "number" ? "Nothing is left to search within the budget." : "Nothing is left to search.")
      : first === Beliefs.NOWHERE ? "First find the rooms that are not found yet." : `Go first to ${nodeName(view, first)}${sought}.`);
    make("p", { class: "answer" }, side, by === "likeness" ? `Annotators note one down in ${percent(anywhere)} of such buildings, by the model ${model}.`
      : `At least one in the building: ${percent(anywhere)}, by the ${by === "table" ? "table" : "model"} ${model}.`);
    if (within) make("p", {}, side, `${things.length > 1 ? "All found" : "Found"} within the budget: ${percent(within)}.`);
    if (how) make("p", {}, side, how);
  }

  /* List the rooms in the order in which the robot would search them. */
  function planWay(side, view) {
    const { plan, here, things } = view.answer, say = (x) => typeof x === "number" ? Beliefs.cost(view, x) : "–";
    const several = things.length > 1, timed = plan.length > 0 && typeof plan[0].seconds === "number";
    if (plan.length < (timed ? 1 : 2)) return;
    make("h3", {}, side, "The planned way" + (here ? " from " + nodeName(view, here) : ""));
    const body = table(side, "way", ["", "room", several ? "any is there" : "it is there", ...(timed ? ["time"] : ["way", "look"]),
      ...(several ? ["all found by then", "any found by then"] : ["ended by then"])]);
    for (const { step, room, probability, way, look, seconds, found, any_found: any } of plan.slice(0, FIRST)) {
      const row = make("tr", {}, body);
      make("i", { class: "stop" }, make("td", {}, row), step);
      make("th", { scope: "row" }, row, nodeName(view, room));
      const texts = [percent(probability), ...(timed ? [Math.round(seconds) + " s"] : [say(way), say(look)]), percent(found), ...(several ? [percent(any)] : [])];
      for (const text of texts) make("td", {}, row, text);
    }
    if (plan.length > FIRST) make("p", {}, side, `${plan.length - FIRST} more`);
  }

  /* List what the home has taught, of the thing that was asked for or of all. */
  function teach(side, of, rows) {
    if (!rows.length) return;
    make("h3", {}, side, "What this home has taught");
    const body = table(side, "taught", [of, of === "place" ? "share" : "places", "sightings", "last", "told"]);
    for (const [name, ...texts] of rows) {
      const row = make("tr", {}, body);
      make("th", { scope: "row" }, row, name);
      for (const text of texts) make("td", {}, row, text || "–");
    }
  }

  function summarize(side, view, node) {
    make("h3", {}, side, "Seen and expected");
    const of = Beliefs.numbers(view, node, ALL), room = node ? view.rooms[node - 1] : null;
    paragraph(side, [amount(of.seen)], " seen, ", [amount(of.more)], " more expected",
      ...(of.unseen === null ? ["."] : ["; true: ", [amount(of.unseen)], " more."]));
    const bare = view.classless[node];
    if (bare) paragraph(side, [amount(bare)], " seen without a class.");
    const share = room ? room.share : view.hidden_share;
    if (room && room.kind) paragraph(side, "Taken for: " + room.kind + ".");
    paragraph(side, room && !room.visited ? "Not visited yet. The expectation follows from the rest of the building and the kind of room."
      : share === 0 ? "All of it was searched." : "About " + percent(share) + " of its objects are assumed to be unseen.");
    paragraph(side, "Expected by " + (view.model || "an unnamed model") + ".");
  }

  function placeOf(side, view, { node, sought }) {
    const place = Beliefs.rankRooms(view, sought).filter((of) => Number.isInteger(of.node)).findIndex((of) => of.node === node) + 1;
    const rank = place ? ` Rank ${place} of ${view.rooms.length} rooms${view.left_out ? " shown" : ""}.` : "";
    make("p", { class: "answer" }, side, Beliefs.sayLong(view, node, sought) + "." + rank);
  }

  function rankRooms(side, view, sought, go) {
    make("h3", {}, side, sought === ALL ? "Rooms by expected unseen objects" : "Rooms by the probability of " + Beliefs.leastOf(view, sought));
    if (sought > ALL) make("p", { class: "answer" }, side, "In the whole building: " + Beliefs.sayLong(view, 0, sought) + ".");
    const most = sought === ALL ? Beliefs.mostWorth(view, ALL) : 1;
    const ranked = Beliefs.rankRooms(view, sought);
    rank(side, "rooms", ranked.map((of) => ({
      name: nodeName(view, of.node), words: (sought < ALL ? Beliefs.sayPlace(view, of, sought) : Beliefs.sayShort(of, sought)) + mark(of, sought),
      share: Beliefs.worth(of, sought) / most, key: of.node, chosen: Number.isInteger(of.node) && (() => go({ node: of.node })),
    })));
    if (sought !== ALL && ranked.some((of) => of.unseen !== null)) make("p", {}, side, "✓ the truth has an unseen one here, – it has none.");
  }
  const mark = (of, sought) => of.unseen === null || sought === ALL ? "" : of.unseen > 0 ? " ✓" : " –";

  function rankClasses(side, view, { node, sought }, go) {
    make("h3", {}, side, "Most likely classes not seen " + (node ? "here" : "anywhere"));
    const ranked = Beliefs.rankClasses(view, node, 6);
    if (!ranked.length) make("p", {}, side, "No unseen class is likely.");
    rank(side, "classes", ranked.map((of) => ({
      name: view.classes[of.class], words: Beliefs.sayShort(of, of.class) + mark(of, of.class), share: of.chance,
      key: of.class, picked: of.class === sought, chosen: () => go({ sought: of.class }),
    })));
    if (ranked.length && view.truth) make("p", {}, side, "✓ the truth has an unseen one here, – it has none.");
  }

  /* Make a list of buttons with words and a bar; rows after the first `FIRST` are folded. */
  function rank(side, kind, rows) {
    const list = (parent, some, start) => {
      const made = make("ol", { class: "rank " + kind, start }, parent);
      for (const { name, words, share, key, picked, chosen } of some) {
        const item = make("li", {}, made), row = chosen ? button(item, picked ? "picked" : "", "", chosen) : make("div", {}, item);
        if (chosen) row.dataset.key = key;
        make("span", { class: "what" }, row, name);
        row.append(" ");
        make("span", { class: "much" }, row, words);
        make("span", { class: "more", style: { width: `${(100 * share).toFixed(1)}%` } }, make("span", { class: "bar" }, row));
      }
    };
    list(side, rows.slice(0, FIRST), 1);
    if (rows.length <= FIRST) return;
    const folded = make("details", {}, side);
    make("summary", {}, folded, `${rows.length - FIRST} more`);
    list(folded, rows.slice(FIRST), FIRST + 1);
  }

  function listClasses(side, view, { node, sought }) {
    const truth = view.truth && view.truth[node], expected = view.expected[node], seen = view.input[node];
    const rows = expected.map((x, c) => ({ class: c, most: Math.max(x, truth ? truth[c] : 0) }))
      .filter((row) => row.most > 0.05).sort((a, b) => b.most - a.most || a.class - b.class);
    make("h3", {}, side, "Every class");
    const key = make("div", { class: "key" }, side);
    for (const [name, text] of [["seen", "seen"], ["more", "more expected"], ...(truth ? [["true", "true count"]] : [])]) {
      const item = make("span", {}, key);
      make("i", { class: name }, item);
      item.append(text);
    }
    const body = table(side, "histogram", ["class", "", "seen", "more expected", "at least one unseen", ...(truth ? ["truly unseen"] : [])]);
    const asked = Beliefs.asked(view, sought), picked = asked ? view.classes.indexOf(asked.class) : sought;
    const most = Math.max(1, ...expected, ...(truth || []));
    for (const { class: c } of rows) {
      const of = Beliefs.numbers(view, node, c);
      const row = make("tr", c === picked ? { class: "picked" } : {}, body);
      make("th", { scope: "row" }, row, view.classes[c]);
      const bar = make("div", { class: "bar" }, make("td", { class: "bars" }, row));
      make("div", { class: "seen", style: { width: `${100 * of.seen / most}%` } }, bar);
      make("div", { class: "more", style: { width: `${100 * of.more / most}%` } }, bar);
      if (truth) make("div", { class: "true", style: { left: `calc(${100 * truth[c] / most}% - 2px)` } }, bar);
      for (const text of [amount(of.seen), amount(of.more), percent(of.chance), ...(truth ? [amount(of.unseen)] : [])])
        make("td", {}, row, text);
    }
  }

  /* Make a table with a head, and return its body. */
  function table(side, name, heads) {
    const made = make("table", { class: name }, side), head = make("tr", {}, make("thead", {}, made));
    for (const text of heads) make(text ? "th" : "td", text ? { scope: "col" } : {}, head, text);
    return make("tbody", {}, made);
  }

  /* Write the legend of colours and shades. */
  function explain(box, view, look) {
    box.replaceChildren();
    const most = Beliefs.mostWorth(view, look.sought);
    const one = look.sought !== ALL, name = soughtName(view, look.sought);
    const entry = (kind, text) => { const item = make("span", {}, box); make("i", { class: kind }, item); item.append(text); };
    if (!look.plan) { entry("building", "building"); entry("room", "room"); }
    entry(one ? "sought" : "object", one ? "seen " + name : "seen object");
    if (!one && view.classless[0]) entry("classless", "seen, belongs to no class");
    entry("blind", "blind node (faint: unsure)");
    if (view.answer && view.answer.here) entry("robot", "the robot");
    if (look.sought < ALL && view.answer.plan.length) entry("stop", "the planned way");
    const scale = make("span", {}, box, one ? `${Beliefs.leastOf(view, look.sought)}: 0 %` : "more expected: 0");
    make("span", { class: "scale" }, scale);
    scale.append(one ? percent(most) : amount(most));
    if (view.rooms.some((room) => !room.visited)) make("span", {}, box, "dashed: not visited");
    make("p", {}, box, "A class is a kind of object that the model counts. A blind node is an object that it expects and the robot has not seen.");
  }
  return { show, explain };
})();
