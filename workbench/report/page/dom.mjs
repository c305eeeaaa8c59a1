// Elements of the page.

/** The element with an id. */
export const $ = (id) => document.getElementById(id);

/** An element with properties and children; text is never read as HTML. */
export function make(tag, properties = {}, ...children) {
  const element = document.createElement(tag);
  for (const [name, value] of Object.entries(properties)) {
    if (name in element) element[name] = value;
    else element.setAttribute(name, value);
  }
  element.append(...children);
  return element;
}

/** A button that does something. */
export const button = (text, onclick, properties = {}) =>
  make("button", { type: "button", onclick, ...properties }, text);

/** An element of a drawing with attributes and children. */
export function shape(tag, attributes, ...children) {
  const element = document.createElementNS("http://www.w3.org/2000/svg", tag);
  for (const [name, value] of Object.entries(attributes)) element.setAttribute(name, value);
  element.append(...children);
  return element;
}

/** A paragraph, a table's row, and a cell of it. */
export const paragraph = (className, ...children) => make("p", { className }, ...children);
export const tableRow = (...cells) => make("tr", {}, ...cells);
export const tableCell = (text, properties = {}) => make("td", properties, text);

/** The choices of a select, (value, text) each, and which is chosen. */
export function offer(select, pairs, value) {
  select.replaceChildren(...pairs.map(([v, text]) => make("option", { value: v, selected: v === value }, text)));
}

/** Says above everything else what is wrong. */
export function complain(text) {
  $("notice").textContent = text;
  $("notice").hidden = false;
}
