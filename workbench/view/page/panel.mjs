// What stands beside the picture: where one is, what is drawn, and what can be chosen.

export class Panel {
  /** Fill the page's fields; `chosen` hears of what is changed. */
  constructor(rooms, storeys, chosen) {
    this.fields = Object.fromEntries(["cell", "drawn", "triangles", "rate", "note", "why-what", "why-verdict", "why-text"].map((id) => [id, document.getElementById(id)]));
    const list = document.getElementById("rooms");
    list.replaceChildren(...rooms.map(({ name }) => Object.assign(document.createElement("option"), { value: name })));
    const room = document.getElementById("room");
    room.addEventListener("change", () => {
      const found = rooms.find(({ name }) => name === room.value);
      if (found) chosen("cell", found.cell);
      this.note(found || !room.value ? "" : `no room is called ${room.value}`);
    });
    this.inputs = {};
    for (const name of ["view", "mode", "height"]) {
      this.inputs[name] = document.getElementById(name);
      this.inputs[name].addEventListener("input", (event) => chosen(name, event.target.value));
    }
    for (const name of ["verdicts", "outlines"]) {
      this.inputs[name] = document.getElementById(name);
      this.inputs[name].addEventListener("change", (event) => chosen(name, event.target.checked));
    }
    const [low, high] = storeys;
    Object.assign(this.inputs.height, { min: low, max: high, step: (high - low) / 200, value: high });
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

  /** Show that something was chosen elsewhere. */
  set(name, value) {
    const input = this.inputs[name];
    if (input.type === "checkbox") input.checked = value;
    else input.value = value;
  }
}
