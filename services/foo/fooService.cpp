// foo -- makes breakfast. The model of a service class in C++: read it before you write your own.
//
// The report of 1996 has it as its example (section 1.5): recipes such as
//
//     foo.a   -breakfast -where kitchen -tempo presto
//     foo.b   -breakfast -where garden -freshJuice -tempo adagio
//
// make foo.a and foo.b different objects of one class. Its twin in Tcl is services/bar/bar.tcl.
#include <sorma.h>

namespace {

// An error or warning is declared once, with its symbol for programs and its text for people, and raised in one line.
const sorma::Prototype kAsleep{sorma::Severity::warning, "FOO ASLEEP", 1, "{}: without -breakfast there is only a look at the {}"};

class Foo : public sorma::Service {
public:
    // One table says all about the class. CTRL, -help, -dump, configure, completion and manual come from it.
    static sorma::Class describe() {
        return sorma::Class::of<Foo>("foo", "makes breakfast")
            .flag("-breakfast", &Foo::breakfast_, {.help = "serve breakfast"})
            .text("-where", &Foo::where_, {.help = "where to serve it"})
            .flag("-freshJuice", &Foo::freshJuice_, {.help = "with juice, freshly pressed"})
            .choice("-tempo", &Foo::tempo_, {"largo", "adagio", "andante", "allegro", "presto", "piano"},
                    {.help = "how fast, in musicians' words"})
            .writes(sorma::Field::text, {}, "", "what is served, where and how")
            .example("foo EXEC");
    }

    // EXEC works in place: the request comes in m, the result leaves in m.
    void exec(sorma::Message& m) override {
        m.clear();
        if (!breakfast_) m.warn(kAsleep, name(), where_);
        m.text = breakfast_ ? "breakfast" : "nothing";
        if (freshJuice_) m.text += " with fresh juice";
        m.text += " in the " + where_ + ", " + tempo_;
    }

private:
    // The values of the members after construction are the options' defaults.
    bool breakfast_ = false;
    std::string where_ = "kitchen";
    bool freshJuice_ = false;
    std::string tempo_ = "andante";
};

}  // namespace

// Tcl calls this when it loads the package: register the class with the SORM of that interpreter.
extern "C" SORMA_EXPORT int Foo_Init(Tcl_Interp* interp) {
    return sorma::provide(interp, "sorma::service::foo", "1.0", {Foo::describe()});
}
