// Opens Foxglove Studio as its own web page does. Layouts and settings are kept in memory, one
// layout is there from the beginning (/layout.json) and is the user's last one; were it asked for in
// the address, Studio would load it beside its own default, and the later one stays. The data source
// is taken from the address (?ds=foxglove-websocket&ds.url=...).
"use strict";

(async () => {
  const data = await (await fetch("/layout.json")).json();
  const baseline = { data, savedAt: new Date().toISOString() };
  const layouts = new Map([
    ["ours", { id: "ours", name: "ours", permission: "CREATOR_WRITE", baseline }],
  ]);
  const layoutStorage = {
    list: async () => [...layouts.values()],
    get: async (_namespace, id) => layouts.get(id),
    put: async (_namespace, layout) => (layouts.set(layout.id, layout), layout),
    delete: async (_namespace, id) => void layouts.delete(id),
    importLayouts: async () => {},
  };
  const settings = new Map([
    ["colorScheme", "light"],
    ["hideSignInPrompt", true],
    ["launchPreference", "web"],
    ["telemetry.telemetryEnabled", false],
    ["ui.open-dialog-startup", false],
  ]);
  const appConfiguration = {
    get: (key) => settings.get(key),
    set: async (key, value) => void settings.set(key, value),
    addChangeListener: () => {},
    removeChangeListener: () => {},
  };
  localStorage.setItem("studio.profile-data", JSON.stringify({ currentLayoutId: "ours" }));
  await initI18n();
  await waitForFonts();
  const dataSources = [new FoxgloveWebSocketDataSourceFactory()];
  const properties = {
    deepLinks: [window.location.href], appConfiguration, dataSources, layoutStorage,
    extensionLoaders: [], enableGlobalCss: true,
  };
  ReactDOM.render(React.createElement(App, properties), document.getElementById("root"));
})();
