/* Elements of the page. What comes from the data is text or an attribute, never markup.

   A `style` is an object, set property by property: the page's policy refuses it as an attribute. */
const Elements = (() => {
  "use strict";
  const NS = "http://www.w3.org/2000/svg";

  function fill(made, { style = {}, ...attributes }, parent, text) {
    for (const [key, value] of Object.entries(attributes)) made.setAttribute(key, value);
    for (const [name, value] of Object.entries(style)) made.style.setProperty(name, value);
    if (text !== undefined) made.textContent = text;
    if (parent) parent.append(made);
    return made;
  }
  /* Make an element of a picture, or of the page, and hang it into its parent. */
  const draw = (tag, attributes, parent, text) =>
    fill(document.createElementNS(NS, tag), attributes, parent, text);
  const make = (tag, attributes, parent, text) =>
    fill(document.createElement(tag), attributes, parent, text);
  return { draw, make };
})();
