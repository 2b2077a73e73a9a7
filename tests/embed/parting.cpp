// parting.cpp ADDRESS -- objects that, while they are removed at the end of a program, look for each other and stop something
// elsewhere. Comm has gone by then; their proxies go on until they go themselves. Prints how many were heard.
#include <cstdio>

#include "comm/comm.h"
#include "sorma.h"

namespace {

using namespace sorma;

std::string where;
int heard = 0;

class Stops : public Service {
public:
    static Class describe() {
        return Class::of<Stops>("stops", "stops something elsewhere when it is removed").reads(Field::text, {}, "", "").example("stops EXEC");
    }
    void exec(Message&) override { arm_ = sorm().get("echo@" + where); }
    void removing() override {
        for (int i = 0; i < 8; ++i) sorm().find("stops." + std::to_string(i));
        Message m;
        m.text = "stop";
        arm_.exec(m);
        if (m.text == "stop") ++heard;
    }

private:
    Reference arm_;
};

}  // namespace

int main(int argc, char** argv) {
    if (argc != 2) return std::fputs("usage: parting ADDRESS\n", stderr), 2;
    where = argv[1];
    {
        Sorm sorm;
        {
            Comm comm(sorm);
            sorm.add(Stops::describe());
            std::string reply;
            for (int i = 0; i < 8; ++i) sorm.dispatch("stops." + std::to_string(i) + " EXEC", reply);
            sorm.dispatch("dict CTRL -add @elsewhere 127.0.0.1:1", reply);     // so that each looks where its name leads now
        }
    }
    std::printf("heard %d\n", heard);
}
