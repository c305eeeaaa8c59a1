// What stands beside the picture: where one is, what is drawn, and what can be chosen.

import { legend } from "./colours.mjs";

const FIELDS = ["cell", "drawn", "triangles", "levels", "memory", "misses", "rate", "note", "why-what", "why-verdict", "why-text"];
const VALUES = ["view", "mode", "colours", "height", "speed", "target", "cache", "pace"];
const TICKS = ["outlines", "sequences", "wedge", "labels", "edges", "depth", "freeze"];

export class Panel {
  /** Fill the page's fields; `chosen` hears of what is changed. */
  constructor(database, storeys, chosen) {
    const rooms = database.rooms();
    const byId = (id) => document.getElementById(id);
    this.fields = Object.fromEntries(FIELDS.map((id) => [id, byId(id)]));
    this.find("room", rooms.map(({ name }) => name), (name) => {
      const found = rooms.find((room) => room.name === name);
      if (found) chosen("cell", found.cell);
      return found;
    });
    const { names } = database.head;
    this.find("object", [...new Set(names)].filter(Boolean), (name) => {
      const id = names.indexOf(name);
      if (id >= 0) chosen("object", id);
      return id >= 0;
    });
    this.inputs = Object.fromEntries([...VALUES, ...TICKS].map((name) => [name, byId(name)]));
    for (const name of VALUES) this.inputs[name].addEventListener("input", (event) => event.target.value && chosen(name, event.target.value));
    for (const name of TICKS) this.inputs[name].addEventListener("change", (event) => chosen(name, event.target.checked));
    byId("depth").parentElement.hidden = !database.depthCells.length;
    const [low, high] = storeys;
    Object.assign(this.inputs.height, { min: low, max: high, step: (high - low) / 200, value: high });
    byId("record").addEventListener("click", () => chosen("record"));
    byId("stop").addEventListener("click", () => chosen("stop"));
    byId("path").addEventListener("change", async (event) => {
      const [file] = event.target.files;
      if (file) chosen("path", await file.text());
      event.target.value = "";
    });
  }

  /** A field for a name; `go(name)` is whether there is one. */
  find(id, names, go) {
    document.getElementById(`${id}s`).replaceChildren(...names.map((value) => Object.assign(document.createElement("option"), { value })));
    const input = document.getElementById(id);
    input.addEventListener("change", () => this.note(!input.value || go(input.value) ? "" : `no ${id} is called ${input.value}`));
  }

  /** Say why something is seen or not: its title, verdict and text; nothing for null. */
  why(found) {
    document.getElementById("why").hidden = !found;
    if (!found) return;
    this.say({ "why-what": found.title, "why-verdict": found.verdict ?? "kept", "why-text": found.text });
    this.fields["why-verdict"].className = `key ${found.verdict ?? "unknown"}`;
  }

  /** Text by field. */
  say(texts) {
    for (const [id, text] of Object.entries(texts)) {
      if (this.fields[id].textContent !== text) this.fields[id].textContent = text;
    }
  }

  note(text) {
    this.say({ note: text });
  }

  recording(goesOn) {
    document.getElementById("record").textContent = goesOn ? "Stop and save" : "Record";
  }

  plot(numbers, target) {
    const style = getComputedStyle(document.body);
    numbers.draw(target, style.getPropertyValue("--ink"), style.getPropertyValue("--quiet"));
  }

  /** Show that something was chosen elsewhere. */
  set(name, value) {
    const input = this.inputs[name];
    if (input.type === "checkbox") input.checked = value;
    else if (document.activeElement !== input || input.tagName === "SELECT") input.value = value;
    if (name === "colours") {
      document.getElementById("legend").replaceChildren(...legend(value).map(([word, colour]) => {
        const key = Object.assign(document.createElement("span"), { className: "key", textContent: word });
        key.style.setProperty("--key", `#${colour.toString(16).padStart(6, "0")}`);
        return key;
      }));
    }
  }
}
