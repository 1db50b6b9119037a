// What is drawn over the city: the ring below whoever is chosen, names, plans with their goals.

import { THREE } from "./three.js";

export class Overlay {
  /** @param {any} scene @param {import("./view.js").View} view */
  constructor(scene, view) {
    this.view = view;
    const ring = new THREE.RingGeometry(0.55, 0.72, 40);
    this.ring = new THREE.Mesh(ring, new THREE.MeshBasicMaterial({ color: 0xffb000, transparent: true, opacity: 0.9, depthTest: true }));
    this.ring.visible = false;
    this.ring.renderOrder = 3;
    this.plan = new THREE.Group();
    this.plan.renderOrder = 4;
    scene.add(this.ring, this.plan);
    this.layer = document.createElement("div");
    this.layer.className = "labels";
    view.canvas.parentElement?.append(this.layer);
    /** @type {{at: any, element: HTMLElement}[]} */
    this.labels = [];
    this._key = "null";
    /** @type {Map<number | string, HTMLElement>} */
    this.names = new Map();
  }

  /** @param {{x: number, y: number, z: number, radius: number} | null} at */
  select(at) {
    this.ring.visible = Boolean(at);
    if (!at) return;
    this.ring.position.set(at.x, at.y, at.z + 0.06);
    this.ring.scale.setScalar(Math.max(at.radius, 0.6));
  }

  /**
   * Draw what somebody plans.
   * @param {{goals?: any[], path?: number[][]} | null} plan
   */
  setPlan(plan) {
    const key = JSON.stringify(plan ?? null);
    if (key === this._key) return;
    this._key = key;
    this.plan.clear();
    for (const label of this.labels) label.element.remove();
    this.labels = [];
    if (!plan) return;
    const path = plan.path ?? [];
    if (path.length > 1) {
      const points = path.map(([x, y, z]) => new THREE.Vector3(x, y, z + 0.35));
      const curve = new THREE.CatmullRomCurve3(points, false, "catmullrom", 0.05);
      const tube = new THREE.TubeGeometry(curve, Math.min(6 * points.length, 400), 0.09, 5);
      this.plan.add(new THREE.Mesh(tube, new THREE.MeshBasicMaterial({ color: 0x00b7d8, transparent: true, opacity: 0.85 })));
    }
    for (const goal of plan.goals ?? []) {
      if (!goal.position) continue;
      const [x, y, z] = goal.position;
      const pin = new THREE.Mesh(new THREE.ConeGeometry(0.35, 1.1, 8), new THREE.MeshBasicMaterial({ color: 0x00b7d8 }));
      pin.rotation.x = -Math.PI / 2;
      pin.position.set(x, y, z + 1.6);
      this.plan.add(pin);
      this.labels.push({ at: new THREE.Vector3(x, y, z + 2.6), element: this._label(goal.text ?? goal.label ?? "", "goal") });
    }
  }

  /** @param {string} text @param {string} kind @returns {HTMLElement} */
  _label(text, kind) {
    const element = document.createElement("div");
    element.className = `label ${kind}`;
    element.textContent = text;
    this.layer.append(element);
    return element;
  }

  /**
   * Show names above people and robots, and above what goes on.
   * @param {{entity: number | string, text: string, x: number, y: number, z: number, chosen: boolean, kind?: string}[]} named
   */
  setNames(named) {
    const there = new Set(named.map((n) => n.entity));
    for (const [entity, element] of this.names) {
      if (!there.has(entity)) {
        element.remove();
        this.names.delete(entity);
      }
    }
    for (const one of named) {
      let element = this.names.get(one.entity);
      if (!element) {
        element = this._label(one.text, one.kind ?? "name");
        this.names.set(one.entity, element);
      }
      if (element.textContent !== one.text) element.textContent = one.text;
      element.classList.toggle("chosen", one.chosen);
      this._put(element, new THREE.Vector3(one.x, one.y, one.z));
    }
  }

  update() {
    for (const { at, element } of this.labels) this._put(element, at.clone());
  }

  /** @param {HTMLElement} element @param {any} at */
  _put(element, at) {
    const { clientWidth, clientHeight } = this.view.canvas;
    at.project(this.view.camera);
    const hidden = at.z > 1 || at.z < -1 || Math.abs(at.x) > 1.05 || Math.abs(at.y) > 1.05;
    element.style.display = hidden ? "none" : "";
    if (!hidden) element.style.transform = `translate(-50%, -100%) translate(${((at.x + 1) / 2) * clientWidth}px, ${((1 - at.y) / 2) * clientHeight}px)`;
  }
}
